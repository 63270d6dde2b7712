// What Khronos' validator says of a glTF file: node check_gltf.mjs FILE, the report as JSON on standard output.
import { readFileSync } from "node:fs";
import validator from "gltf-validator";

const report = await validator.validateBytes(new Uint8Array(readFileSync(process.argv[2])));
process.stdout.write(JSON.stringify(report));
