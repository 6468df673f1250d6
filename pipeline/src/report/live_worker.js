// Solves the knee off the page's thread: opens the module and the pack, then answers requests in order.
"use strict";
/** @type {(bytes: BlobPart) => Promise<ArrayBuffer>} */
const unpacked = (bytes) => new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).arrayBuffer();
/** What the module gives out (live/src/web.rs). @type {{ memory: WebAssembly.Memory, room(length: number): number, open(): void, ask(): void, reply(): number, reply_length(): number }} */
let doors;

/** @type {(bytes: Uint8Array) => void} */
const written = (bytes) => {
  const at = doors.room(bytes.length);
  new Uint8Array(doors.memory.buffer, at, bytes.length).set(bytes);
};

// what the calibration's trials reached, by the head of the pack (live/src/pack.rs); none of a knee that was not calibrated
/** @type {(pack: Uint8Array) => Record<string, [number, number]> | null} */
const reached = (pack) => {
  const length = new DataView(pack.buffer, pack.byteOffset).getUint32(0, true);
  const { spec } = JSON.parse(new TextDecoder().decode(pack.subarray(4, 4 + length)));
  return (spec.calibrated && spec.calibrated.reach) || null;
};

// the memory may have grown while the knee was asked, so it is looked at anew
const read = () => JSON.parse(new TextDecoder().decode(new Uint8Array(doors.memory.buffer, doors.reply(), doors.reply_length())));

/** @type {(module: BlobPart, knee: BlobPart) => Promise<object>} */
async function opened(module, knee) {
  const [code, bytes] = await Promise.all([unpacked(module), unpacked(knee)]);
  const pack = new Uint8Array(bytes);
  doors = /** @type {any} */ ((await WebAssembly.instantiate(code)).instance.exports);
  written(pack);
  doors.open();
  const about = read();
  return about.fault ? about : { ...about, reach: reached(pack) };
}

/** @type {(request: object) => object} */
function asked(request) {
  if (!doors) return { fault: "no knee is open" };
  written(new TextEncoder().encode(JSON.stringify(request)));
  doors.ask();
  return read();
}

onmessage = async ({ data }) => {
  const from = performance.now();
  let reply;
  try {
    reply = data.open ? await opened(data.open.module, data.open.knee) : asked(data.request);
  } catch (error) {
    reply = { fault: String(error), broken: true };
  }
  postMessage({ id: data.id, reply, ms: performance.now() - from });
};
