// Making elements of a page.

const element = (name, attributes = {}, ...children) => furnished(document.createElement(name), attributes, children);
const svg = (name, attributes = {}, ...children) => furnished(document.createElementNS("http://www.w3.org/2000/svg", name), attributes, children);

function furnished(made, attributes, children) {
  for (const [key, value] of Object.entries(attributes)) {
    // As an attribute the page's Content-Security-Policy forbids it.
    if (key === "style") made.style.cssText = value;
    else if (value !== null && value !== false) made.setAttribute(key, value === true ? "" : value);
  }
  made.append(...children);
  return made;
}

/** A row of buttons of which one is pressed, or several where `several`. */
function makeChoice(place, options, onChoose) {
  for (const { value, title, hint } of options) {
    const button = element("button", { type: "button", "data-value": value, title: hint ?? null }, title);
    button.addEventListener("click", () => onChoose(value));
    place.append(button);
  }
  return (chosen) => {
    for (const button of place.children) button.setAttribute("aria-pressed", String(chosen.includes(button.dataset.value)));
  };
}

const by = (id) => document.getElementById(id);

/** Puts tables in a place: [[title, [[name, value], …]], …]; hides it where there are none. */
function makeTables(place, sections) {
  for (const [title, rows] of sections) {
    const body = element("tbody", {}, ...rows.map(([name, value]) => element("tr", {}, element("th", { scope: "row" }, name), element("td", {}, value))));
    place.append(element("h3", {}, title), element("table", { "aria-label": title }, body));
  }
  place.hidden = !sections.length;
}

/** Replaces the page's work by a readable message. */
function showTrouble(error) {
  const known = error instanceof Trouble;
  const box = element("div", { class: "message", role: "alert", id: "trouble" },
    element("h2", {}, known ? error.message : "The page cannot be shown."),
    element("p", {}, known ? error.remedy : "Something unexpected went wrong. Please report the text below."));
  const details = known ? error.details : String(error?.stack ?? error);
  if (details) box.append(element("pre", {}, details));
  by("main").replaceWith(box);
  for (const button of document.querySelectorAll(".actions button")) button.hidden = true;
}

/** Begins a page; what `begin` resolves to are the properties of `homofact`, for programs that drive the page. */
function startPage(begin) {
  window.homofact = { ready: begin() };
  window.homofact.ready.then(
    (handle) => { Object.defineProperties(window.homofact, Object.getOwnPropertyDescriptors(handle)); },
    showTrouble,
  );
}
