// A choice of the site's versions in the sidebar, where the site lies beside others: ../versions.json lists their folders.
document.addEventListener("DOMContentLoaded", async () => {
    const root = new URL(document.documentElement.dataset.content_root || "./", location.href);
    const brand = document.querySelector(".sidebar-brand");
    if (location.protocol === "file:") {
        return;
    }
    let versions;
    try {
        versions = await (await fetch(new URL("../versions.json", root))).json();
    } catch {
        return; // A single version.
    }
    if (!brand || !Array.isArray(versions) || versions.length < 2) {
        return;
    }
    const own = root.pathname.split("/").filter(Boolean).pop();
    const page = location.pathname.slice(root.pathname.length);
    const choice = document.createElement("select");
    choice.className = "site-versions";
    choice.setAttribute("aria-label", "Version of the documentation");
    for (const name of versions) {
        choice.add(new Option(name, name, name === own, name === own));
    }
    choice.addEventListener("change", async () => {
        const there = new URL(`../${choice.value}/`, root);
        const same = new URL(page, there);
        // A page that the other version does not have: its first page.
        location.href = (await fetch(same, { method: "HEAD" })).ok ? same : there;
    });
    brand.after(choice);
});
