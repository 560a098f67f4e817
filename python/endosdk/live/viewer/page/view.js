// The page of `endosdk view`: shows what the server sends, and asks it to measure.
import { Cloud } from "./cloud.js";
import { Plots } from "./plots.js";
import { Marks } from "./marks.js";
import { drawMap, drawScale, shaded } from "./maps.js";

const $ = (id) => document.getElementById(id);
const cloud = new Cloud($("cloud"));
const plots = new Plots($("plots"));
const socket = new WebSocket(`ws://${location.host}${location.pathname}live`);
socket.binaryType = "arraybuffer";

let legend = null;
let facts = null;
let nextId = 1;
const waiting = new Map(); // id of a wish -> what to do with its answer

function ask(wish, done) {
  const id = nextId++;
  if (wish.do !== "measure") $("refused").textContent = ""; // marks ask again with every picture
  if (done) waiting.set(id, done);
  socket.send(JSON.stringify({ ...wish, id }));
}

const marks = new Marks($("marks"), $("measured"), $("hint"), (kind, pixels, done) =>
  ask({ do: "measure", kind, pixels }, done),
);

function tell(text) {
  $("message").textContent = text || "";
}

function showState(state) {
  $("play").textContent = state.playing ? "pause" : "play";
  $("play").disabled = $("step").disabled = state.ended;
  $("restart").disabled = !state.again;
  $("record").classList.toggle("on", Boolean(state.recording));
  $("record").textContent = state.recording ? "stop recording" : "record";
  const parts = [];
  if (state.silent_s) parts.push(`no new frame for ${state.silent_s} s`);
  document.body.classList.toggle("silent", state.silent_s > 0);
  if (state.error) parts.push(state.error);
  if (state.ended && !state.error) parts.push("the source has ended");
  if (state.recording) parts.push(`recording to ${state.recording}`);
  if (state.dropped) parts.push(`${state.dropped} frames dropped`);
  parts.push(...state.faults);
  tell(parts.join(" · "));
}

function showReasons() {
  $("reasons").replaceChildren(
    ...legend.reasons.map(({ name, label, colour }) => {
      const item = document.createElement("li");
      const patch = document.createElement("i");
      patch.style.background = `rgb(${shaded(colour)})`;
      const share = 100 * facts.reasons[name];
      item.append(patch, `${label} ${share.toFixed(1)} %`);
      return item;
    }),
  );
}

function showCauses() {
  $("causes").replaceChildren(
    ...facts.causes.map(({ name, value, measure, meaning, remedy }) => {
      const item = document.createElement("li");
      const strong = document.createElement("b");
      strong.textContent = name;
      const digits = Math.abs(value) < 10 ? 2 : 0;
      item.append(strong, ` ${meaning}: ${remedy} (${measure}: ${value.toFixed(digits)})`);
      return item;
    }),
  );
}

async function show(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  facts = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  let at = 4 + length;
  const [jpeg, values, reasons] = facts.parts.map((size) => buffer.slice(at, (at += size)));
  const picture = await createImageBitmap(new Blob([jpeg], { type: "image/jpeg" }));
  const left = $("left");
  [left.width, left.height] = facts.size;
  const context = left.getContext("2d", { willReadFrequently: true });
  context.drawImage(picture, 0, 0, left.width, left.height);
  marks.resize(left.width, left.height);
  const levels = new Uint16Array(values);
  const causes = new Uint8Array(reasons);
  drawMap($("map"), facts, levels, causes, legend);
  drawScale($("scale"), facts.map, legend.ramp, facts.valid_share > 0);
  cloud.show(facts, levels, context.getImageData(0, 0, left.width, left.height));
  plots.add({
    "frames a second": [facts.frames_per_second, "", 0],
    "delay": [facts.delay_ms, "ms", 0],
    "pixels with a value": [100 * facts.valid_share, "%", 0, 100],
    "rig: rows apart": [facts.rows_off_px, "px", 0],
    "rig: right camera turned by": [facts.turn_deg, "°", 0],
  });
  $("map-name").textContent = `${facts.map.name} (${facts.map.unit})`;
  $("frame").textContent = `frame ${facts.number}${facts.count ? ` of ${facts.count}` : ""}, ${(facts.stamp_ns / 1e9).toFixed(2)} s`;
  $("status").textContent = facts.status;
  $("status").className = `badge ${facts.status}`;
  showReasons();
  showCauses();
  showState(facts);
  marks.again();
  document.body.dataset.turn = facts.turn;
  socket.send("drawn");
}

socket.onmessage = ({ data }) => {
  if (data instanceof ArrayBuffer) return void show(data);
  const message = JSON.parse(data);
  if (message.legend) {
    legend = message.legend;
    $("source").textContent = message.source;
  }
  if (message.state) showState(message.state);
  if (message.refused && !waiting.has(message.id)) $("refused").textContent = message.refused;
  if (waiting.has(message.id)) {
    waiting.get(message.id)(message);
    waiting.delete(message.id);
  }
};
socket.onclose = () => tell("the server has ended");

$("play").onclick = () => ask({ do: $("play").textContent });
$("step").onclick = () => ask({ do: "step" });
$("restart").onclick = () => ask({ do: "restart" });
$("record").onclick = () => ask({ do: "record" });
$("home").onclick = () => cloud.home();
$("clear").onclick = () => marks.clear();
for (const button of document.querySelectorAll(".tool")) {
  button.onclick = () => {
    for (const other of document.querySelectorAll(".tool")) other.classList.toggle("on", other === button);
    marks.take(button.dataset.tool);
  };
}
document.querySelector(".tool").click();
