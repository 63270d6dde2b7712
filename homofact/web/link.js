// The view in the page's address, so that a link keeps it: #light=sky&from=35.3,30&camera=0,0 …

const number = (low, high) => ({
  write: (x) => String(Number(x.toFixed(2))),
  read: (text) => (/^-?\d+(\.\d+)?$/.test(text) && Number(text) >= low && Number(text) <= high ? Number(text) : undefined),
});
const oneOf = (values) => ({ write: String, read: (text) => (values.includes(text) ? text : undefined) });
const angles = (up) => ({
  write: ({ azimuth, elevation }) => [azimuth, elevation].map((x) => Number(x.toFixed(2))).join(","),
  read: (text) => {
    const parts = text.split(",");
    const [azimuth, elevation] = [number(-180, 180).read(parts[0]), number(-up, up).read(parts[1] ?? "")];
    return parts.length === 2 && azimuth !== undefined && elevation !== undefined ? { azimuth, elevation } : undefined;
  },
});

/** What the link holds: [its name, the state's field, how it is written and read]. */
function linkFields(layers, surfaces) {
  const keys = layers.map((layer) => layer.key);
  const shown = {
    write: (visible) => visible.join(","),
    read: (text) => {
      const found = text.split(",");
      return found.every((key) => keys.includes(key)) && new Set(found).size === found.length
        ? keys.filter((key) => found.includes(key)) : undefined;
    },
  };
  return [
    ["show", "visible", shown], ["on", "surface", oneOf(surfaces)], ["light", "light", oneOf(LIGHTS)],
    ["from", "lightFrom", angles(90)], ["camera", "camera", angles(89)], ["zoom", "zoom", number(0.3, 12)],
    ["stops", "stops", number(-8, 8)], ["difference", "difference", oneOf(MODES)], ["factor", "factor", oneOf(FACTORS)],
  ];
}

function writeLink(state, fields) {
  return `#${fields.map(([name, field, { write }]) => `${name}=${write(state[field])}`).join("&")}`;
}

/** The fields of the state that a hash holds, or the part of it that cannot be read as {wrong}. */
function readLink(hash, fields) {
  const found = {};
  for (const part of hash.replace(/^#/, "").split("&")) {
    if (!part) continue;
    const [name, ...rest] = part.split("="), known = fields.find((each) => each[0] === name);
    let value;
    try {
      value = known?.[2].read(decodeURIComponent(rest.join("=")));
    } catch {
      // A % without its two digits.
    }
    if (value === undefined || known[1] in found) return { wrong: part.slice(0, 40) };
    found[known[1]] = known[1] === "factor" ? Number(value) : value;
  }
  return { found };
}

/** Keeps the address in line with the view, and the view with an address that is changed by hand. */
class Link {
  constructor(view) {
    this.view = view;
    this.fields = linkFields(view.layers, view.mesh ? ["sphere", "mesh"] : ["sphere"]);
    this.last = null;
    window.addEventListener("hashchange", () => { if (location.hash !== this.last) this.restore(); });
  }

  /** Takes the view from the address; whether it held an exposure too. */
  restore() {
    const { found, wrong } = readLink(location.hash, this.fields);
    if (wrong !== undefined) this.view.note(`The link's view cannot be read (${wrong}) and is left out.`, true);
    if (!found || !Object.keys(found).length) return;
    Object.assign(this.view.state, found);
    if (found.stops === undefined) this.view.auto();
    this.view.changed("layout");
  }

  /** Writes the address once nothing has changed for a while. */
  keep() {
    clearTimeout(this.waiting);
    this.waiting = setTimeout(() => this.write(), 250);
  }

  write() {
    const text = writeLink(this.view.state, this.fields);
    // A page that was only opened keeps its address.
    if (text === this.last || (this.last === null && !location.hash && text === this.first)) return;
    this.last = text;
    try {
      history.replaceState(null, "", text);
    } catch {
      // Pages inside other pages may not have an address of their own.
    }
  }
}
