// Asks the module of a report what it answers, outside a browser.
//   node module.mjs REPORT.html REQUESTS.json REPLIES.json [MODULE.wasm.gz]
// REQUESTS.json is a list of requests; REPLIES.json gets the list of replies, the first being what opening the knee gave.
// Prints the time to open and of each trial [ms].
import fs from "node:fs";
import zlib from "node:zlib";

const [page, requests, replies, module] = process.argv.slice(2);
const html = fs.readFileSync(page, "utf8");
const part = (id) => {
  const text = html.split(`id="${id}">`)[1];
  if (!text) throw new Error(`${page} has no ${id}`);
  return zlib.gunzipSync(Buffer.from(text.split("</script>")[0], "base64"));
};
const code = module ? zlib.gunzipSync(fs.readFileSync(module)) : part("live-module");
const from = performance.now();
const doors = new WebAssembly.Instance(new WebAssembly.Module(code)).exports;
const write = (bytes) => {
  const at = doors.room(bytes.length);
  new Uint8Array(doors.memory.buffer, at, bytes.length).set(bytes);
};
const read = () => JSON.parse(Buffer.from(doors.memory.buffer, doors.reply(), doors.reply_length()).toString("utf8"));
write(part("live-knee"));
doors.open();
const out = [read()];
const opened = performance.now() - from;
const times = [];
for (const request of JSON.parse(fs.readFileSync(requests, "utf8"))) {
  const start = performance.now();
  write(Buffer.from(JSON.stringify(request)));
  doors.ask();
  out.push(read());
  times.push(performance.now() - start);
}
fs.writeFileSync(replies, JSON.stringify(out));
const sorted = [...times].sort((a, b) => a - b);
const at = (share) => (sorted[Math.min(sorted.length - 1, Math.floor(share * sorted.length))] ?? 0).toFixed(1);
console.log(`open ${opened.toFixed(0)} ms; ${times.length} requests: median ${at(0.5)} ms, p95 ${at(0.95)} ms, most ${at(1)} ms; module ${code.length} bytes`);
