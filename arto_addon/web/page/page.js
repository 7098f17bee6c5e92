// The page: what the visitor turns and chooses.

const element = (id) => document.getElementById(id);
const stage = element("stage"), still = element("still"), canvas = element("picture");
const calm = matchMedia("(prefers-reduced-motion: reduce)");
const dials = { world: 0, turn: 0, strength: 1, own: 1, groups: {}, lights: {}, behind: true };
let picture = null, asked = false, before = false, easing = 0;

const degrees = () => Math.round((dials.turn * 180) / Math.PI);
const wrapped = (turn) => turn - 2 * Math.PI * Math.round(turn / (2 * Math.PI));
const stops = () => Math.log2(dials.strength);

function say(text) {
  element("said").textContent = text;
}

// What stands before: the first world as it was, with all its lights.
const first = () => ({ world: 0, turn: 0, strength: 1, own: 1, groups: {}, lights: {}, behind: dials.behind });

function show() {
  if (asked) return;
  asked = true;
  requestAnimationFrame(() => {
    asked = false;
    if (picture) picture.draw(before ? first() : dials);
    else if (ARTO.pictures.length) still.src = ARTO.pictures[before ? 0 : dials.world];
  });
}

function tell() {
  const turn = degrees(), said = `${turn}°`, more = stops();
  element("turn").value = turn;
  element("turn").setAttribute("aria-valuetext", `${turn} degrees`);
  element("turn-said").textContent = said;
  stage.setAttribute("aria-valuenow", turn);
  stage.setAttribute("aria-valuetext", `${turn} degrees`);
  const text = `${more > 0 ? "+" : ""}${more.toFixed(1).replace("-0.0", "0.0")} stops`;
  element("strength").value = more;
  element("strength").setAttribute("aria-valuetext", text);
  element("strength-said").textContent = text;
}

function change(turns) {
  if (before && turns !== "before") setBefore(false);
  tell();
  show();
}

function setTurn(turn) {
  cancelAnimationFrame(easing);
  dials.turn = wrapped(turn);
  change();
}

// Turn there in a quarter of a second, or at once where motion is not wanted.
function easeTo(turn) {
  const from = dials.turn, by = wrapped(turn - from), begun = performance.now();
  if (calm.matches || !picture) return setTurn(turn);
  cancelAnimationFrame(easing);
  const step = (now) => {
    const t = Math.min((now - begun) / 250, 1);
    dials.turn = wrapped(from + by * (1 - (1 - t) ** 3));
    change();
    if (t < 1) easing = requestAnimationFrame(step);
  };
  easing = requestAnimationFrame(step);
}

function setBefore(on) {
  before = on;
  element("before").setAttribute("aria-pressed", String(on));
  element("mark").hidden = !on;
  say(on ? "Before: the light as it was" : "Your light");
  show();
}

function setWorld(index) {
  dials.world = index;
  dials.lights = {};
  const name = ARTO_WORLDS[index].name;
  for (const input of element("worlds").querySelectorAll("input")) input.checked = +input.value === index;
  if (picture) addLights();
  say(`World: ${name}`);
  change();
}

function reset() {
  dials.strength = 1;
  dials.own = 1;
  dials.groups = {};
  dials.lights = {};
  if (picture) addLights();
  easeTo(0);
  change();
  say("Reset");
}

let ARTO_WORLDS = ARTO.worlds.map((name) => ({ name, lights: [] }));

// A slider of a light: its factor in stops, off at its lower end.
function addSlider(into, id, name, get, set) {
  const label = document.createElement("label"), input = document.createElement("input");
  const said = document.createElement("output");
  label.htmlFor = input.id = id;
  label.append(name, said);
  Object.assign(input, { type: "range", min: -5, max: 3, step: 0.1 });
  input.value = get() > 0 ? Math.log2(get()) : -5;
  const tellIt = () => {
    const value = +input.value;
    const text = value <= -5 ? "off" : `${value > 0 ? "+" : ""}${value.toFixed(1)} stops`;
    said.textContent = text;
    input.setAttribute("aria-valuetext", text);
  };
  input.addEventListener("input", () => {
    set(+input.value <= -5 ? 0 : 2 ** +input.value);
    tellIt();
    change();
  });
  tellIt();
  into.append(label, input);
}

function addLights() {
  const box = element("lights"), lights = ARTO_WORLDS[dials.world].lights;
  box.querySelector(".all")?.remove();
  const all = document.createElement("div");
  all.className = "all";
  lights.forEach((light, i) =>
    addSlider(all, `light-${i}`, light.name, () => dials.lights[light.name] ?? 1,
      (x) => (dials.lights = { ...dials.lights, [light.name]: x })));
  const groups = picture.about.lamps.filter((name) => name !== "own");
  if (picture.about.lamps.includes("own"))
    addSlider(all, "lamps", groups.length ? "All lamps" : "Lamps", () => dials.own, (x) => (dials.own = x));
  groups.forEach((name, i) =>
    addSlider(all, `lamp-${i}`, name.replace(/^own_/, ""), () => dials.groups[name] ?? 1,
      (x) => (dials.groups[name] = x)));
  box.hidden = !all.children.length;
  box.append(all);
}

// A small picture of a world, as it stands around.
function thumbnail(index) {
  const small = document.createElement("canvas"), w = (small.width = 96), h = (small.height = 48);
  const context = small.getContext("2d"), data = context.createImageData(w, h);
  const level = levelsOf(picture.map(`world_${index}`, ARTO_WORLDS[index])).find((l) => l.side <= 64);
  const light = new Float32Array(3 * w * h);
  for (let y = 0, i = 0; y < h; y++)
    for (let x = 0; x < w; x++, i++) {
      const azimuth = (0.5 - (x + 0.5) / w) * 2 * Math.PI, up = (0.5 - (y + 0.5) / h) * Math.PI;
      const flat = Math.cos(up);
      readLevel(level, Math.cos(azimuth) * flat, Math.sin(azimuth) * flat, Math.sin(up), light, 3 * i);
    }
  const level95 = Float32Array.from(light).sort()[Math.floor(light.length * 0.9)] || 1;
  for (let i = 0; i < w * h; i++) {
    for (let c = 0; c < 3; c++)
      data.data[4 * i + c] = 255 * Math.min((0.7 * light[3 * i + c]) / level95, 1) ** (1 / 2.2);
    data.data[4 * i + 3] = 255;
  }
  context.putImageData(data, 0, 0);
  return small;
}

function addWorlds() {
  const box = document.createElement("div");
  box.className = "all";
  ARTO_WORLDS.forEach((world, i) => {
    const label = document.createElement("label"), input = document.createElement("input");
    const name = document.createElement("span");
    Object.assign(input, { type: "radio", name: "world", value: i, checked: i === 0 });
    name.textContent = world.name;
    let small;
    if (picture) small = thumbnail(i);
    else Object.assign((small = document.createElement("img")), { src: ARTO.pictures[i], alt: "" });
    small.setAttribute("aria-hidden", "true");
    input.addEventListener("change", () => setWorld(i));
    label.append(input, small, name);
    box.append(label);
  });
  element("worlds").append(box);
}

function listen() {
  let held = null;
  stage.addEventListener("pointerdown", (e) => {
    if (!picture || e.button) return;
    held = { x: e.clientX, turn: dials.turn };
    stage.setPointerCapture(e.pointerId);
    stage.classList.add("held");
  });
  stage.addEventListener("pointermove", (e) => {
    if (held) setTurn(held.turn + ((e.clientX - held.x) / stage.clientWidth) * Math.PI);
  });
  for (const name of ["pointerup", "pointercancel"])
    stage.addEventListener(name, () => {
      held = null;
      stage.classList.remove("held");
    });
  stage.addEventListener("keydown", (e) => {
    if (e.ctrlKey || e.altKey || e.metaKey) return;
    const step = ((e.shiftKey ? 30 : 5) * Math.PI) / 180;
    const keys = {
      ArrowLeft: () => easeTo(dials.turn - step),
      ArrowRight: () => easeTo(dials.turn + step),
      ArrowUp: () => setStrength(Math.min(stops() + 0.2, 3)),
      ArrowDown: () => setStrength(Math.max(stops() - 0.2, -3)),
      Home: () => easeTo(0),
      b: () => setBefore(!before),
      r: reset,
    };
    const act = /^[1-9]$/.test(e.key)
      ? e.key <= ARTO_WORLDS.length && (() => setWorld(e.key - 1))
      : keys[e.key];
    if (!act || (!picture && e.key.startsWith("Arrow"))) return;
    e.preventDefault();
    act();
  });
  element("turn").addEventListener("input", (e) => setTurn((e.target.value * Math.PI) / 180));
  element("strength").addEventListener("input", (e) => setStrength(+e.target.value));
  element("before").addEventListener("click", () => setBefore(!before));
  element("behind").addEventListener("click", () => {
    dials.behind = !dials.behind;
    element("behind").setAttribute("aria-pressed", String(dials.behind));
    change();
  });
  element("reset").addEventListener("click", reset);
  element("dials").addEventListener("submit", (e) => e.preventDefault());
  const full = element("full");
  full.hidden = !stage.requestFullscreen;
  full.addEventListener("click", () => stage.requestFullscreen());
}

function setStrength(value) {
  dials.strength = 2 ** value;
  change();
}

async function load() {
  if (ARTO.base64) {
    const text = atob(ARTO.base64), bytes = new Uint8Array(text.length);
    for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
    return readShot(bytes.buffer);
  }
  const answer = await fetch(ARTO.url);
  if (!answer.ok) throw new Error(`The light could not be loaded (${answer.status}).`);
  return readShot(await answer.arrayBuffer());
}

function begin(shot) {
  picture = new Picture(canvas, shot);
  ARTO_WORLDS = shot.head.worlds;
  dials.behind = shot.head.about.behind !== 0;
  element("behind").hidden = !shot.arrays.through.some((x) => x > 0);
  element("behind").setAttribute("aria-pressed", String(dials.behind));
  canvas.addEventListener("webglcontextlost", (e) => e.preventDefault());
  canvas.addEventListener("webglcontextrestored", () => {
    picture = new Picture(canvas, shot);
    show();
  });
  picture.draw(dials);
  canvas.hidden = false;
  still.hidden = true;
  addLights();
  element("wait").textContent = "";
}

// Where there is no WebGL 2, each world is a picture, and nothing turns.
function withoutTurning(why) {
  picture = null;
  canvas.hidden = true;
  still.hidden = false;
  stage.classList.add("still");
  stage.removeAttribute("tabindex");
  stage.setAttribute("role", "group");
  stage.setAttribute("aria-label", "The picture");
  for (const name of ["valuemin", "valuemax", "valuenow", "valuetext"]) stage.removeAttribute(`aria-${name}`);
  element("sliders").hidden = true;
  element("sliders").style.display = "none";
  element("hint").textContent = why;
  element("wait").textContent = "";
}

(async () => {
  stage.style.setProperty("--ratio", ARTO.ratio);
  document.documentElement.style.setProperty("--ratio", ARTO.ratio);
  if (ARTO.pictures.length) still.src = ARTO.pictures[0];
  still.alt = ARTO.title;
  const webgl = !!document.createElement("canvas").getContext("webgl2") && !!window.DecompressionStream;
  if (!webgl) withoutTurning("This browser has no WebGL 2: each world is a picture here, and the light does not turn.");
  else {
    try {
      begin(await load());
    } catch (error) {
      const local = location.protocol === "file:" && ARTO.url;
      withoutTurning(local ? `Open ${ARTO.single} to turn the light: browsers read no other files from a disk.` : String(error.message));
    }
  }
  addWorlds();
  listen();
  element("dials").hidden = false;
  tell();
  document.documentElement.dataset.ready = picture ? "turns" : "still";
})();
