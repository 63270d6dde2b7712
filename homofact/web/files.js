// Files that are dropped on the page.

/** Calls `open` with each file dropped anywhere on the page; `overlay` is shown while files are held over it. */
function receiveFiles(overlay, open) {
  const holds = (event) => event.dataTransfer?.types.includes("Files");
  let depth = 0;
  const show = () => { overlay.hidden = depth <= 0; };
  document.addEventListener("dragenter", (event) => { if (holds(event)) { depth++; show(); } });
  document.addEventListener("dragleave", (event) => { if (holds(event)) { depth--; show(); } });
  document.addEventListener("dragover", (event) => { if (holds(event)) event.preventDefault(); });
  document.addEventListener("drop", (event) => {
    if (!holds(event)) return;
    event.preventDefault();
    depth = 0;
    show();
    for (const file of event.dataTransfer.files) open(file);
  });
}
