// The pictures as a file.

/** The pictures that are shown, side by side, each under its title. */
function composed(title, pictures) {
  const [gap, head] = [8, 44], { width, height } = pictures[0].canvas;
  const canvas = document.createElement("canvas");
  canvas.width = pictures.length * (width + gap) - gap;
  canvas.height = height + head;
  const context = canvas.getContext("2d");
  context.fillStyle = "#151619";
  context.fillRect(0, 0, canvas.width, canvas.height);
  context.textBaseline = "middle";
  pictures.forEach(({ title: name, canvas: picture }, k) => {
    const left = k * (width + gap);
    context.drawImage(picture, left, head);
    context.fillStyle = "#e7e8ea";
    context.font = `600 16px ${getComputedStyle(document.body).fontFamily}`;
    context.fillText(k ? name : `${title}: ${name}`, left + 12, head / 2, width - 24);
  });
  return canvas;
}

/** A file's name of words: letters, digits and dashes. */
const fileName = (...words) => `${words.join(" ").normalize("NFKD").replace(/[^\p{L}\p{N}]+/gu, "-").replace(/^-+|-+$/g, "").slice(0, 80) || "picture"}.png`;

async function saveCanvas(canvas, name) {
  const blob = await new Promise((done) => { canvas.toBlob(done, "image/png"); });
  if (!blob) throw new Trouble("The picture is too large for this browser to save.", "Make the window smaller.");
  const link = element("a", { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}
