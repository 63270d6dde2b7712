// What the npm package ktx-parse finds in a KTX2 file, as JSON: node read_ktx2.mjs FILE.
import { readFileSync } from "node:fs";
import { read } from "ktx-parse";

const container = read(new Uint8Array(readFileSync(process.argv[2])));
const levels = container.levels.map((level) => ({
  data: Buffer.from(level.levelData).toString("hex"),
  uncompressedByteLength: level.uncompressedByteLength,
}));
process.stdout.write(JSON.stringify({ ...container, levels }));
