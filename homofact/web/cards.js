// The parts of the page that are made from the data: cards with pictures and facts, the textures, the notes.

const bytesOf = { float32: 4, float16: 2, uint8: 1 };
const colourOf = (layers, key) => {
  const rest = layers.filter((layer) => layer.key !== "source");
  return `var(--${key === "source" ? "third" : ["fit", "second"][rest.findIndex((layer) => layer.key === key) % 2]})`;
};

/** A card a layer: title and picture. */
function makeCards(place, layers) {
  return new Map(layers.map((layer) => {
    const canvas = element("canvas", { tabindex: "0", role: "img", "aria-label": layer.title });
    const scale = element("div", { class: "scale", hidden: true });
    const heading = element("h2", {}, layer.title), subtitle = element("p");
    const card = element("article", { class: "card", style: `--colour: ${colourOf(layers, layer.key)}` },
      element("header", {}, element("span", { class: "dot" }), heading, subtitle),
      element("div", { class: "picture" }, canvas, scale));
    place.append(card);
    return [layer.key, { card, canvas, scale, subtitle, context: canvas.getContext("2d", { alpha: false }) }];
  }));
}

/** From so many letters on a fact is a sentence: it stands under the table, not in a column. */
const SENTENCE = 60;

/**
 * The layers' facts: a row a layer, a column a name; on narrow pages CSS makes each row a list with its names. Sentences
 * are paragraphs under the table, those of a layer after its title.
 */
function makeNumbers(place, layers) {
  const all = [...new Set(layers.flatMap((layer) => layer.facts.map(([name]) => name)))];
  place.hidden = !all.length;
  const long = new Set(layers.flatMap((layer) => layer.facts.filter(([, text]) => text.length >= SENTENCE).map(([name]) => name)));
  const names = all.filter((name) => !long.has(name));
  const body = element("tbody");
  for (const layer of layers) {
    const own = new Map(layer.facts);
    const cells = names.map((name) => element("td", { "data-name": name, class: own.has(name) ? null : "none" }, own.get(name) ?? "–"));
    const colour = `--colour: ${colourOf(layers, layer.key)}`;
    body.append(element("tr", { style: colour, "data-key": layer.key }, element("th", { scope: "row" }, layer.title), ...cells));
  }
  const head = element("tr", {}, element("td"), ...names.map((name) => element("th", { scope: "col" }, name)));
  if (names.length) place.append(element("table", {}, element("thead", {}, head), body));
  for (const layer of layers) {
    const said = layer.facts.filter(([name]) => long.has(name));
    if (!said.length) continue;
    place.append(element("div", { class: "said", style: `--colour: ${colourOf(layers, layer.key)}` },
      element("h2", {}, layer.title),
      ...said.map(([name, text]) => element("p", { "data-name": name }, element("b", {}, `${name}: `), text))));
  }
}

/** The scale bar under a difference. */
function fillScale(scale, state, title, reference) {
  const range = differenceRange(state);
  const colours = RAMPS[state.difference === "absolute" ? "absolute" : "signed"];
  const number = (value) => String(Number(value.toPrecision(3)));
  const [low, middle, high] = {
    signed: [`−${number(range)}`, "0", `+${number(range)} of white`],
    absolute: ["0", number(range / 2), `${number(range)} of white`],
    ratio: [`−${number(range)}`, "0", `+${number(range)} stops`],
  }[state.difference];
  const what = {
    signed: `luminance, ${title} − ${reference}`, absolute: `luminance, |${title} − ${reference}|`,
    ratio: `luminance, log₂(${title} / ${reference})`,
  }[state.difference];
  scale.replaceChildren(what, element("i", { style: `background: linear-gradient(90deg, ${colours.join(", ")})` }),
    element("span", {}, element("span", {}, low), element("span", {}, middle), element("span", {}, high)));
}

/** The textures of all layers that have some, hatched where no pair of directions reads. */
function makeTextures(place, layers) {
  for (const layer of layers) {
    if (!layer.textures.length) continue;
    const row = element("div", { class: "texture-row" });
    for (const texture of layer.textures) row.append(textureFigure(texture));
    const hatched = layer.textures.some((texture) => texture.mask)
      ? [element("p", {}, "Hatched: texels that no pair of directions reads.")] : [];
    place.append(element("div", { class: "texture-set", style: `--colour: ${colourOf(layers, layer.key)}` },
      element("h2", {}, layer.title), row, ...hatched));
  }
  place.hidden = !place.children.length;
}

/** What texels stand for, four numbers each. */
function decoded({ texels, type, scale, bias }) {
  const values = Float32Array.from(toNumbers(texels, type), type === "uint8" ? (x) => x / 255 : (x) => x);
  if (scale) for (let i = 0; i < values.length; i++) if (i % 4 < 3) values[i] = values[i] * scale[i % 4] + bias[i % 4];
  return values;
}

function textureFigure(texture) {
  const { rows, columns, type, mask } = texture;
  const values = decoded(texture);
  const reached = (i) => !mask || (mask[i >> 3] >> (7 - (i & 7))) & 1;
  const inside = [];
  for (let i = 0; i < rows * columns; i++) if (reached(i)) inside.push(...values.subarray(4 * i, 4 * i + 3));
  const missing = rows * columns - inside.length / 3;
  inside.sort((a, b) => a - b);
  const [least, largest] = [inside[0], inside.at(-1)];
  // Shown from the first to the last percent: a few texels that samples hardly hold may be anywhere.
  let low = inside[Math.floor(0.01 * (inside.length - 1))] ?? 0, high = inside[Math.ceil(0.99 * (inside.length - 1))] ?? 0;
  // A texture that varies by less than a factor e looks as flat as it is.
  const spare = Math.max(0, 1 - (high - low)) / 2;
  [low, high] = [low - spare, high + spare];
  const zoom = Math.max(1, Math.floor(160 / Math.max(rows, columns)));
  const stretch = rows === 1 ? 48 : zoom, wide = columns === 1 ? 48 : zoom;
  const canvas = element("canvas", { role: "img", "aria-label": `Texture ${texture.caption}, ${rows} × ${columns} texels` });
  [canvas.width, canvas.height] = [columns * wide, rows * stretch];
  const context = canvas.getContext("2d"), picture = context.createImageData(canvas.width, canvas.height);
  for (let y = 0; y < canvas.height; y++) {
    for (let x = 0; x < canvas.width; x++) {
      const i = Math.floor(y / stretch) * columns + Math.floor(x / wide), at = 4 * (y * canvas.width + x);
      const hatched = (x + y) % 6 < 2;
      for (let c = 0; c < 3; c++) {
        const grey = high > low ? (255 * (values[4 * i + c] - low)) / (high - low) : 128;
        picture.data[at + c] = reached(i) ? grey : hatched ? [96, 82, 38][c] : [40, 38, 34][c];
      }
      picture.data[at + 3] = 255;
    }
  }
  context.putImageData(picture, 0, 0);
  const bytes = rows * columns * 4 * bytesOf[type];
  const size = bytes >= 10240 ? `${(bytes / 1024).toFixed(0)} KiB` : `${(bytes / 1024).toFixed(1)} KiB`;
  const number = (value) => value.toFixed(2).replace("-", "−");
  const range = !(least <= largest) ? "no texel is read"
    : `${texture.quantity} ${number(least)} to ${number(largest)}`;
  const words = [`${texture.caption}: ${rows} × ${columns} texels, ${type}, ${size} as RGBA, ${range}`,
    ...(missing ? [`no pair of directions reads ${missing} texels`] : [])].join("; ");
  return element("figure", { title: words }, canvas, element("figcaption", {}, element("b", {}, texture.caption),
    `${rows} × ${columns}`, element("br"), range));
}

/** The layers' values at one pair of directions, with angles, or a hint. */
function fillReading(place, point, rows) {
  if (!point) {
    place.replaceChildren(element("p", {}, "Move over a picture to read the angles and the BRDF there, in sr⁻¹."));
    return;
  }
  const { wi, wo } = point, degrees = (x) => `${((180 / Math.PI) * x).toFixed(1)}°`;
  const half = wi.map((x, k) => x + wo[k]), apart = wi.map((x, k) => x - wo[k]);
  const angles = element("div", { class: "reading-angles" });
  for (const [name, value] of [["θi", fromNormal(wi)], ["θo", fromNormal(wo)], ["θh", fromNormal(half)], ["θd", Math.atan2(Math.hypot(...apart), Math.hypot(...half))]]) {
    angles.append(element("div", {}, element("span", {}, name), degrees(value)));
  }
  if (wi[2] <= 0) {
    place.replaceChildren(angles, element("p", {}, "The light is under the surface's horizon here: no reflection."));
    return;
  }
  const number = (x) => (x >= 1000 || (x > 0 && x < 0.001) ? x.toExponential(2).replace("-", "−") : x.toPrecision(4));
  const table = element("table", { class: "reading" }, element("thead", {}, element("tr", {},
    element("th", {}, "BRDF in sr⁻¹"), ...["R", "G", "B"].map((c) => element("th", {}, c)))), element("tbody"));
  for (const { title, values } of rows) {
    table.lastChild.append(element("tr", {}, element("th", { title }, title),
      ...["r", "g", "b"].map((c, k) => element("td", { class: c }, number(values[k])))));
  }
  place.replaceChildren(angles, table);
}
