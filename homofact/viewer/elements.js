// Making elements of a page.

function element(name, attributes = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
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
