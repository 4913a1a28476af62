// Takes the pictures of deploy/guide/pictures/gallery anew: steps each scene that ships to its moment and keeps
// what the page shows, without its panels, as a JPEG of 480 × 320. Look at each picture afterwards.
//
//   node tests/gallery/pictures.mjs PROGRAM [NAME]...
//
// moments.json has the moment of each scene, and may turn and zoom the view, choose colours, tick boxes of the menu
// View, and drag a tool of the mouse. The environment: ../browser/check.mjs. Software that draws is slow, so the page
// is tiny until the moment has come.
import { spawn } from "node:child_process";
import { mkdirSync, readFileSync, writeFileSync } from "node:fs";
import net from "node:net";
import path from "node:path";
import { fileURLToPath } from "node:url";

import { LAUNCH, MINUTE, chromium, until, watch } from "../browser/check.mjs";

const here = path.dirname(fileURLToPath(import.meta.url));
const out = path.join(here, "../../deploy/guide/pictures/gallery");
const scenes = process.env.SCINDO_SCENES ?? path.join(here, "../../server/world/scenes");
const moments = JSON.parse(readFileSync(path.join(here, "moments.json"), "utf8"));
const [program, ...names] = process.argv.slice(2);
/** Size on the screen; the picture is half of it, so that edges are smooth. */
const SIZE = { width: 960, height: 640 };
/** Most bytes of a picture. */
const MOST = 40_000;

mkdirSync(out, { recursive: true });
const browser = await chromium.launch(LAUNCH);
try {
  for (const name of names.length > 0 ? names : Object.keys(moments)) {
    await take(name, moments[name]).catch((error) => {
      process.exitCode = 1;
      console.error(`FAILED  ${name}: ${error.stack}`);
    });
  }
} finally {
  await browser.close();
}

async function take(name, moment) {
  const page = await browser.newPage({ viewport: { width: 96, height: 64 }, colorScheme: "light" });
  watch(page);
  const [web, zenoh] = [await freePort(), await freePort()];
  const server = spawn(program, ["run", path.join(scenes, `${name}.toml`), "--listen", `tcp/127.0.0.1:${zenoh}`, "--viewer", `127.0.0.1:${web}`], { stdio: ["ignore", "ignore", "inherit"] });
  try {
    await open(page, `http://127.0.0.1:${web}/?quality=full`);
    await page.evaluate(({ colour, show = [] }) => {
      const set = (id, key, value) => {
        const control = document.getElementById(id);
        control[key] = value;
        control.dispatchEvent(new Event("change"));
      };
      if (colour) set("colour", "value", colour);
      for (const id of show) set(id, "checked", true);
    }, moment);
    await rewind(page);
    await advance(page, name, moment.at_s);
    await page.setViewportSize(SIZE);
    await frame(page, moment);
    if (moment.drag) {
      await press(page, "pause");
      await drag(page, moment.drag);
    }
    await keep(page, path.join(out, `${name}.jpg`));
  } finally {
    await page.close();
    const ended = new Promise((done) => server.once("exit", done));
    server.kill();
    await ended;
  }
}

/** Opens the page without its panels and waits for the first surface. */
async function open(page, url) {
  for (let attempt = 0; ; attempt++) {
    try {
      await page.goto(url);
      break;
    } catch (error) {
      if (attempt > 300) throw error;
      await page.waitForTimeout(200);
    }
  }
  await page.addStyleTag({ content: "#ui, #labels, #overlay { display: none !important } * { outline: none !important }" });
  await until(page, "a surface arrives", 5 * MINUTE, () => window.scindo?.bodies().length > 0 && window.scindo.bodies().every((body) => body.vertices > 0));
}

/** Pauses the scene and takes it back to its start, from which steps lead to the same moment on any machine. */
async function rewind(page) {
  await pause(page);
  await press(page, "reset");
  if (await page.evaluate(() => document.getElementById("reset").classList.contains("sure"))) await press(page, "reset");
  await until(page, "the scene is at its start", 5 * MINUTE, () => window.scindo.bodies().every((body) => body.simTimeS === 0));
}

/** Makes single steps up to a simulated time [s]. */
async function advance(page, name, at_s) {
  await press(page, "step");
  await until(page, "the first step is made", 5 * MINUTE, () => window.scindo.bodies()[0].simTimeS > 0);
  const step_s = await page.evaluate(() => window.scindo.bodies()[0].simTimeS);
  const steps = Math.round(at_s / step_s);
  for (let done = 1; done < steps; ) {
    const next = Math.min(steps, done + 20);
    for (; done < next; done++) await press(page, "step");
    await page.waitForFunction((time_s) => window.scindo.bodies().every((body) => body.simTimeS > time_s), (done - 0.5) * step_s, { timeout: 5 * MINUTE, polling: 50 });
  }
  console.log(`ok      ${name}: ${steps} steps of ${step_s} s`);
}

/** Presses a button of the page, which is not seen. */
async function press(page, id) {
  await page.evaluate((id) => document.getElementById(id).click(), id);
}

/** Pauses the scene. The server drops an order that comes before it has heard of the page, so it may take several. */
async function pause(page) {
  await until(page, "the page may pause the scene", MINUTE, () => !document.getElementById("pause").disabled);
  for (let attempt = 0; attempt < 8; attempt++) {
    if (!(await page.evaluate(() => window.scindo.paused()))) await press(page, "pause");
    const paused = await page.waitForFunction(() => window.scindo.paused(), null, { timeout: 10_000, polling: 100 }).catch(() => null);
    if (paused) return;
  }
  throw new Error("the scene cannot be paused");
}

/** Fits the view to the bodies, turns it about the axis up and over [rad], and multiplies its distance. */
async function frame(page, { view = "8", turn: [across, over] = [0, 0], zoom = 1, lift = 0 }) {
  await page.keyboard.press(view);
  const place = await page.evaluate(({ across, over, zoom, lift }) => {
    const { position, target, up, radius } = window.scindo.cameraState();
    const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    const turned = (v, axis, angle) => {
      const [c, s, w] = [Math.cos(angle), Math.sin(angle), cross(axis, v)];
      return v.map((x, i) => c * x + s * w[i] + (1 - c) * dot(axis, v) * axis[i]);
    };
    let way = position.map((x, i) => zoom * (x - target[i]));
    const side = cross(up, way), length = Math.hypot(...side);
    way = turned(turned(way, side.map((x) => x / length), -over), up, across);
    const at = target.map((x, i) => x + lift * radius * up[i]);
    return [at.map((x, i) => x + way[i]), at];
  }, { across, over, zoom, lift });
  // A picture of the view before may be under way.
  for (let twice = 0; twice < 2; twice++) {
    const before = await page.evaluate((place) => {
      window.scindo.camera(...place);
      return window.scindo.counts().pictures;
    }, place);
    await page.waitForFunction((before) => window.scindo.counts().pictures > before, before, { timeout: 2 * MINUTE, polling: 100 });
  }
}

/** Draws a tool of the mouse along points of the picture (0 to 1), pauses, and puts the tool away. */
async function drag(page, { tool, along, depth }) {
  await page.evaluate(([tool, depth]) => {
    window.scindo.hand(tool);
    window.scindo.depth(depth);
  }, [tool, depth]);
  const at = ([x, y]) => [x * SIZE.width, y * SIZE.height];
  await page.mouse.move(...at(along[0]));
  await until(page, "the server knows the tool of the mouse", MINUTE, () => window.scindo.tools().some((tool) => tool.own));
  await page.mouse.down();
  await page.waitForTimeout(1500);
  for (const [i, to] of along.slice(1).entries()) {
    for (let part = 1; part <= 20; part++) {
      await page.mouse.move(...at(to.map((x, k) => along[i][k] + (part / 20) * (x - along[i][k]))));
      await page.waitForTimeout(250);
    }
  }
  await page.waitForTimeout(1500);
  await pause(page);
}

/** Keeps the picture at half its size. */
async function keep(page, file) {
  const png = await page.screenshot();
  const blank = await browser.newPage();
  const jpeg = await blank.evaluate(async ({ base64, width, height }) => {
    const image = new Image();
    image.src = `data:image/png;base64,${base64}`;
    await image.decode();
    const canvas = new OffscreenCanvas(width, height), draw = canvas.getContext("2d");
    draw.imageSmoothingQuality = "high";
    draw.drawImage(image, 0, 0, width, height);
    const bytes = new Uint8Array(await (await canvas.convertToBlob({ type: "image/jpeg", quality: 0.86 })).arrayBuffer());
    return btoa(Array.from(bytes, (byte) => String.fromCharCode(byte)).join(""));
  }, { base64: png.toString("base64"), width: SIZE.width / 2, height: SIZE.height / 2 });
  await blank.close();
  const bytes = Buffer.from(jpeg, "base64");
  if (bytes.length > MOST) throw new Error(`${file} has ${bytes.length} bytes, allowed: ${MOST}`);
  writeFileSync(file, bytes);
  console.log(`${file}: ${bytes.length} bytes`);
}

function freePort() {
  return new Promise((found) => {
    const server = net.createServer().listen(0, "127.0.0.1", () => {
      const { port } = server.address();
      server.close(() => found(port));
    });
  });
}
