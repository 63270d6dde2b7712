// Skies that are turned, resampled beside the page's own thread: 50 to 110 ms that would stop the picture.

/** The worker's program: cube.js as it stands, and an answer to each message. */
const turnerText = () => `"use strict";
const FACES = ${FACES}, FINER = ${FINER}, pictures = new Map();
${[texelOf, environmentCube, haarCoefficients, haarStep].join("\n")}
onmessage = ({ data: { id, picture, size, turn } }) => {
  if (picture) pictures.set(id, picture);
  const cube = environmentCube(pictures.get(id), size, turn), coefficients = haarCoefficients(cube, size);
  postMessage({ cube, coefficients }, [cube.buffer, coefficients.buffer]);
};`;

class Turner {
  /** `done(sky, light)` is called with each answer; what is asked meanwhile waits, the newest alone. */
  constructor(done) {
    this.done = done;
    this.known = new Set();
    this.asked = this.waiting = null;
    try {
      this.worker = new Worker(URL.createObjectURL(new Blob([turnerText()], { type: "text/javascript" })));
    } catch {
      this.worker = null;
      return;
    }
    this.worker.onmessage = ({ data }) => this.answer(data);
    // Where workers may not start, the page does it itself.
    this.worker.onerror = () => {
      const open = this.waiting ?? this.asked;
      this.worker.onmessage = null;
      this.worker.terminate();
      this.worker = this.asked = this.waiting = null;
      if (open) this.ask(...open);
    };
  }

  get busy() {
    return this.asked !== null;
  }

  /** The light of a sky turned by degrees, as `Sky.light` has it: `done` is told, later, or at once where there is no worker. */
  ask(sky, degrees) {
    if (!this.worker) this.done(sky, sky.light(degrees));
    else if (this.asked) this.waiting = [sky, degrees];
    else this.send(sky, degrees);
  }

  /** Leaves unasked what waits, and unsaid what is being answered. */
  forget() {
    this.waiting = null;
    this.unwanted = true;
  }

  send(sky, degrees) {
    this.asked = [sky, degrees];
    this.unwanted = false;
    const message = { id: sky.id, size: sky.size, turn: degrees * DEGREE };
    if (!this.known.has(sky.id)) message.picture = sky.picture;
    this.known.add(sky.id);
    this.worker.postMessage(message);
  }

  answer(light) {
    const [sky] = this.asked, { waiting, unwanted } = this;
    this.asked = this.waiting = null;
    if (waiting) this.send(...waiting);
    if (!unwanted) this.done(sky, light);
  }
}
