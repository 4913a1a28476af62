// Holds the views of the page: upright, in view, colours, overlays, curves, layout at three sizes, words when nothing
// comes; and records. Looks at a running views.toml.
//
//   node views.mjs URL PID PROGRAM FOLDER      PID: the server, to be stopped and continued; FOLDER: its recordings
//
// The environment: check.mjs.
import { spawnSync } from "node:child_process";
import { readFileSync, readdirSync } from "node:fs";
import path from "node:path";
import { LAUNCH, MINUTE, artifacts, chromium, hold, picture, run, until, watch } from "./check.mjs";

const [, , url, server, program, recordings] = process.argv;
const SIZES = [[1440, 900], [800, 600], [390, 780]];

const browser = await chromium.launch(LAUNCH);
await run(async () => {
  const page = await browser.newPage({ viewport: { width: 1440, height: 900 } });
  watch(page);
  await page.goto(url);
  await until(page, "both bodies are drawn", MINUTE, () => window.scindo?.bodies().length === 2 && window.scindo.bodies().every((b) => b.vertices > 0) && window.scindo.counts().pictures > 2);
  await standsUpright(page);
  await looksAsTheSceneSays(page);
  await staysWithWhatIsHeld(page);
  await coloursByQuantity(page);
  await overlaysAndCurves(page);
  await saysWhatDoesNotConverge(page);
  await keysAndButtons(page);
  await worksByKeyboardAlone(page);
  await nothingOverlaps(page);
  await saysThatItIsStalled(page);
  await changesWhatTheSlidersSay(page);
  await takesACutBack(page);
  await changesTheScene(page);
  await page.close();
  await saysThatThereIsNoWebGl();
}, () => browser.close());

/** Gravity along −y: y points upwards in the picture. */
async function standsUpright(page) {
  const { up, rise } = await page.evaluate(() => {
    const [low, high] = [[0.1, 0, 0.03], [0.1, 0.04, 0.03]].map((at) => window.scindo.project(at));
    return { up: window.scindo.cameraState().up, rise: low.y - high.y };
  });
  hold(up.join() === "0,1,0" && rise > 10, `up is against gravity (${up}, the top lies ${rise.toFixed(0)} pixels higher)`);
}

async function looksAsTheSceneSays(page) {
  const [shelf, cube] = await page.evaluate(() => window.scindo.bodies());
  hold(shelf.colour === 0x3f8f6b && cube.opacity === 0.5, "colour and opacity are those of the scene");
  hold(cube.colour !== shelf.colour, "a second body has a colour of its own");
  hold(shelf.isHeld && shelf.heldVertices > 0 && shelf.rest === shelf.vertices, "held places and rest are told");
}

/** The end that was cut off falls until the server lets it sleep; the camera does not go after it, nor does Fit. */
async function staysWithWhatIsHeld(page) {
  await until(page, "the end has come off", MINUTE, () => window.scindo.bodies()[0].simTimeS > 2.4 && window.scindo.bodies()[0].lipTriangles > 0);
  for (const words of ["", " after Fit"]) {
    if (words) await page.keyboard.press("f");
    const { radius, target } = await page.evaluate(() => window.scindo.cameraState());
    hold(radius < 0.2 && target[1] > -0.1, `the camera stays with what is held${words} (radius ${radius.toFixed(3)} m)`);
  }
  await picture(page, "views-1-held.png");
}

async function coloursByQuantity(page) {
  await page.keyboard.press("v");
  for (const mode of ["displacement", "stress", "iterations", "part"]) {
    await page.selectOption("#colour", mode);
    if (mode === "stress") await until(page, "stress comes when it is asked for", MINUTE, () => window.scindo.bodies().every((b) => b.stressPa > 0));
    if (mode !== "part") {
      await until(page, `the legend of ${mode} has a range`, MINUTE, () => /^[\d.]+ ?\D*$/.test(document.getElementById("legend-high").textContent) && parseFloat(document.getElementById("legend-high").textContent) > 0);
    }
    await picture(page, `views-2-${mode}.png`);
  }
  await page.selectOption("#colour", "stress");
  await until(page, "the server says that stress is on", MINUTE, () => window.scindo.effectIsOn("surface stress"));
  await page.click("#legend-hold");
  hold((await page.getAttribute("#legend-hold", "aria-pressed")) === "true", "the range can be held");
  await page.selectOption("#colour", "tissue");
  await until(page, "stress is off again when nobody looks", MINUTE, () => !window.scindo.effectIsOn("surface stress"));
  hold(await page.isHidden("#legend"), "tissue has no legend");
}

async function overlaysAndCurves(page) {
  for (const id of ["show-mesh", "show-held", "show-probes", "show-curves", "show-clip", "show-forces"]) await page.check(`#${id}`);
  await until(page, "the probe has a name and a way", MINUTE, () => [...document.querySelectorAll("#labels div")].some((label) => /^tip · moved /.test(label.textContent)));
  await until(page, "forces, energies and times are drawn", MINUTE, () => window.scindo.curves().slice(0, 4).every((count) => count > 10));
  await until(page, "contact forces have arrows and a row", MINUTE, () => window.scindo.forces().arrows > 0 && /finger on cube/.test(document.getElementById("forces").textContent));
  await picture(page, "views-3-overlays.png");
  await page.click("#clip-flip");
  for (const id of ["show-mesh", "show-held", "show-probes", "show-curves", "show-clip", "show-forces"]) await page.uncheck(`#${id}`);
  await until(page, "what is hidden is not measured", MINUTE, () => !window.scindo.effectIsOn("energies") && !window.scindo.effectIsOn("force publication"));
  await page.keyboard.press("v");
}

/** One iteration is not enough: the number is red, the words stand in the panel and in the head. */
async function saysWhatDoesNotConverge(page) {
  hold(await page.isHidden("#alarm"), "nothing is red while all steps converge");
  await page.evaluate(() => window.scindo.set("body.shelf.solver.iterations", "1"));
  await until(page, "a solver that stops too early is told in words", MINUTE, () => /shelf does not converge/.test(document.getElementById("alarm").textContent));
  hold((await page.locator("#bodies .row[data-level=bad]").count()) >= 2, "its number and its words are red");
  await picture(page, "views-4-red.png");
  await page.evaluate(() => window.scindo.set("body.shelf.solver.iterations", "300"));
  await until(page, "and no more when it converges", MINUTE, () => document.getElementById("alarm").hidden);
}

async function keysAndButtons(page) {
  await page.keyboard.press("?");
  hold(await page.isVisible("#help"), "? shows all keys");
  await picture(page, "views-4-help.png");
  await page.keyboard.press("Escape");
  hold(await page.isHidden("#help"), "Escape closes them");
  const seen = [];
  for (const key of ["5", "6", "7", "8"]) {
    await page.keyboard.press(key);
    seen.push(await page.evaluate(() => window.scindo.cameraState().position.map((x) => x.toFixed(3)).join()));
  }
  hold(new Set(seen).size === 4, "four keys, four views");
  const download = page.waitForEvent("download", { timeout: MINUTE });
  await page.keyboard.press("p");
  hold(/^scindo-views-.*\.png$/.test((await download).suggestedFilename()), "the picture is saved");
  await savesTheSurface(page);
  await recordsAndSavesTheState(page);
  await page.click("#reset");
  hold(await page.evaluate(() => document.getElementById("reset").classList.contains("sure")), "Reset asks before cuts are lost");
  const before = await page.evaluate(() => window.scindo.stats().simTimeS);
  await page.click("#reset");
  await until(page, "the second click resets", MINUTE, (before) => window.scindo.stats().simTimeS < before, before);
}

/** The file is binary glTF with a mesh per body, as large as the bodies on the screen. */
async function savesTheSurface(page) {
  const shut = !(await page.isVisible("#tray"));
  if (shut) await page.click("#view-toggle");
  const download = page.waitForEvent("download", { timeout: MINUTE });
  await page.click("#save-surface");
  const file = await download, bodies = await page.evaluate(() => window.scindo.bodies());
  await file.saveAs(path.join(artifacts, "views-surface.glb"));
  if (shut) await page.click("#view-toggle");
  hold(/^scindo-views-.*\.glb$/.test(file.suggestedFilename()), "the surface is saved");
  const bytes = readFileSync(path.join(artifacts, "views-surface.glb"));
  hold(bytes.toString("latin1", 0, 4) === "glTF" && bytes.readUInt32LE(8) === bytes.length, "it is a whole binary glTF");
  const { meshes, accessors } = JSON.parse(bytes.toString("utf8", 20, 20 + bytes.readUInt32LE(12)));
  const triangles = meshes.map((mesh) => mesh.primitives.reduce((sum, { indices }) => sum + accessors[indices].count / 3, 0));
  hold(triangles.join() === bodies.map((body) => body.triangles).join(), `a mesh per body with its triangles (${triangles})`);
  const corner = (of) => meshes.map((mesh) => accessors[mesh.primitives[0].attributes.POSITION][of]);
  const within = (a, b) => a.every((x, i) => Math.abs(x - b[i]) < 0.02);
  hold(bodies.every((body, i) => within(corner("min")[i], body.min) && within(corner("max")[i], body.max)), "and its size in metres");
}

/** A recording begins and ends by the button, and the state comes as a file; both are recordings that scindo reads. */
async function recordsAndSavesTheState(page) {
  await page.click("#record");
  await until(page, "a recording is shown to everybody", MINUTE, () => !document.getElementById("recording").hidden);
  await until(page, "its time passes", MINUTE, () => !/^0:0[01]$/.test(document.getElementById("recording").textContent));
  await page.screenshot({ path: path.join(artifacts, "views-recording.png") });
  await page.click("#record");
  await until(page, "the recording ends", MINUTE, () => document.getElementById("recording").hidden);
  const shut = !(await page.isVisible("#tray"));
  if (shut) await page.click("#view-toggle");
  const download = page.waitForEvent("download", { timeout: MINUTE });
  await page.click("#save-state");
  const file = await download, state = path.join(artifacts, "views-state.mcap");
  await file.saveAs(state);
  if (shut) await page.click("#view-toggle");
  hold(/^scindo-views-.*\.mcap$/.test(file.suggestedFilename()), "the state is saved");
  const [recording] = readdirSync(recordings);
  for (const mcap of [path.join(recordings, recording), state]) {
    const replay = spawnSync(program, ["replay", mcap, "--verify"], { encoding: "utf8" });
    hold(replay.status === 0, `it is computed again to the bit: ${path.basename(mcap)}${replay.status ? replay.stderr : ""}`);
  }
}

/** Finds the tool, takes it over the tissue, presses and lifts it, and turns the view, without a mouse. */
async function worksByKeyboardAlone(page) {
  await page.keyboard.press("f");
  await page.evaluate(() => document.activeElement?.blur());
  const focused = () => page.evaluate(() => document.activeElement?.dataset["hand"] ?? document.activeElement?.id);
  for (let i = 0; i < 60 && (await focused()) !== "poke"; i++) await page.keyboard.press("Tab");
  hold((await focused()) === "poke", "Tab reaches Poke");
  await page.keyboard.press("Enter");
  hold(await page.evaluate(() => document.querySelector('button[data-hand="poke"]').getAttribute("aria-checked") === "true"), "Enter chooses it");
  await page.evaluate(() => document.activeElement.blur());
  const own = () => window.scindo.tools().find((tool) => tool.own);
  await page.keyboard.press("ArrowRight");
  await until(page, "an arrow key brings the tool to the tissue", MINUTE, own);
  await page.keyboard.press("Enter");
  await until(page, "Enter presses it", MINUTE, () => window.scindo.contactForceN() > 0);
  await page.keyboard.press("PageDown");
  await picture(page, "views-5-keyboard.png");
  await page.keyboard.press("Enter");
  await until(page, "and lifts it", MINUTE, () => window.scindo.contactForceN() === 0);
  await page.keyboard.press("Escape");
  await until(page, "Escape puts it away", MINUTE, () => !window.scindo.tools().some((tool) => tool.own));
  const camera = () => page.evaluate(() => window.scindo.cameraState());
  const away = ({ position, target }) => Math.hypot(...position.map((x, i) => x - target[i]));
  const from = await camera();
  await page.keyboard.press("ArrowLeft");
  await page.keyboard.press("ArrowUp");
  const turned = await camera();
  const moved = Math.hypot(...turned.position.map((x, i) => x - from.position[i])) / away(from);
  hold(Math.abs(moved - 0.085) < 0.03 && Math.abs(away(turned) / away(from) - 1) < 0.01, `arrow keys turn the view (${moved.toFixed(3)} rad)`);
  await page.keyboard.press("+");
  const near = away(await camera()) / away(turned);
  hold(Math.abs(near - 1 / 1.12) < 0.01, `+ comes nearer (${near.toFixed(3)})`);
  const unnamed = await page.evaluate(() => [...document.querySelectorAll("button, input, select, summary")].filter((e) => e.checkVisibility()
    && !(e.textContent.trim() || e.getAttribute("aria-label") || e.labels?.length > 0 || e.title)).map((e) => e.outerHTML));
  hold(unnamed.length === 0, `every control has a name ${unnamed}`);
  await page.keyboard.press("f");
}

/** Nothing lies over anything else, at three sizes, with and without numbers and tray, in light and dark. */
async function nothingOverlaps(page) {
  for (const [width, height] of SIZES) {
    for (const scheme of ["dark", "light"]) {
      await page.setViewportSize({ width, height });
      await page.emulateMedia({ colorScheme: scheme });
      for (const shown of ["none", "numbers", "tray"]) {
        await page.evaluate((shown) => {
          const set = (id, on) => { if ((document.getElementById(id).getAttribute("aria-pressed") === "true") !== on) document.getElementById(id).click(); };
          set("toggle", shown === "numbers");
          set("view-toggle", shown === "tray");
          document.querySelector("button[data-hand=poke]").click();
        }, shown);
        const found = await page.evaluate(overlaps);
        hold(found.length === 0, `nothing overlaps at ${width} × ${height}, ${scheme}, ${shown} shown ${found.join(", ")}`);
        await picture(page, `views-5-${width}-${scheme}-${shown}.png`);
      }
    }
  }
  await page.emulateMedia({ colorScheme: "dark" });
  await page.setViewportSize({ width: 1440, height: 900 });
  await page.keyboard.press("o");
}

/** Runs in the page: pairs of visible things that share more than two pixels, and things beyond the window. */
function overlaps() {
  const things = ["head", "tray", "curves", "panel", "legend", "axes", "hint"].map((id) => document.getElementById(id));
  things.push(...document.querySelectorAll("#bar > *"), ...document.querySelectorAll("#log > *"));
  const boxes = things.map((thing) => {
    let box = thing.getBoundingClientRect();
    if (thing.id === "head") box = DOMRect.fromRect({ x: box.x, y: box.y, height: box.height, width: Math.max(...[...thing.children].map((c) => c.getBoundingClientRect().right)) - box.x });
    // The log hides what is older than it has place for.
    if (thing.parentElement?.id === "log") {
      const top = Math.max(box.top, thing.parentElement.getBoundingClientRect().top);
      box = DOMRect.fromRect({ x: box.x, y: top, width: box.width, height: box.bottom - top });
    }
    return { name: thing.id || thing.className || thing.textContent, box };
  }).filter(({ box }) => box.width > 1 && box.height > 1);
  const found = [];
  boxes.forEach(({ name, box: a }, i) => {
    if (a.left < -1 || a.top < -1 || a.right > innerWidth + 1 || a.bottom > innerHeight + 1) found.push(`${name} beyond the window`);
    for (const { name: other, box: b } of boxes.slice(i + 1)) {
      if (Math.min(a.right, b.right) - Math.max(a.left, b.left) > 2 && Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 2) found.push(`${name} on ${other}`);
    }
  });
  return found;
}

async function saysThatItIsStalled(page) {
  await until(page, "the page is live", MINUTE, () => document.getElementById("link").dataset.state === "live");
  process.kill(Number(server), "SIGSTOP");
  try {
    await until(page, "the page says that it is stalled", MINUTE, () => document.getElementById("link").dataset.state === "stalled");
    await picture(page, "views-6-stalled.png");
  } finally {
    process.kill(Number(server), "SIGCONT");
  }
  await until(page, "and that it goes on", MINUTE, () => document.getElementById("link").dataset.state === "live");
}

/** A slider shows the value of the scene; moved, it changes the server's, which the tray asks for when it opens. */
async function changesWhatTheSlidersSay(page) {
  const tray = page.locator("#view-toggle");
  if ((await tray.getAttribute("aria-pressed")) === "true") await tray.click();
  await tray.click();
  const row = page.locator("#params .param[title*='body.shelf.young_pa']");
  await row.waitFor({ timeout: MINUTE });
  const words = () => row.locator("output").textContent();
  const before = await words();
  hold(/^6\.00e4 Pa$|^60000 Pa$/.test(before), `the slider shows the stiffness of the scene (${before})`);
  await row.locator("input").evaluate((slider) => {
    slider.value = String(Number(slider.value) + 60);
    slider.dispatchEvent(new Event("input"));
    slider.dispatchEvent(new Event("change"));
  });
  const after = await words();
  hold(after !== before, `it moves (${after})`);
  await until(page, "the server says that it has changed", MINUTE, () => /young_pa = /.test(document.getElementById("log").textContent));
  await tray.click();
  await page.evaluate(() => document.querySelector("#params .sliders").replaceChildren());
  await tray.click();
  await row.waitFor({ timeout: MINUTE });
  // The server has four digits of it, the slider shows three.
  const again = await words();
  hold(Math.abs(parseFloat(again) / parseFloat(after) - 1) < 0.01, `and shows what the server has when it is asked again (${again})`);
  await picture(page, "views-8-sliders.png");
}

/** The end that was cut off comes back, and then the slit closes. */
async function takesACutBack(page) {
  const lips = () => page.evaluate(() => window.scindo.bodies()[0].lipTriangles);
  await until(page, "two cuts are there", MINUTE, () => window.scindo.bodies()[0].simTimeS > 2.4);
  for (let left = await lips(); left > 0; left = await lips()) {
    await page.keyboard.press("u");
    await until(page, `a cut with ${left} wound triangles is taken back`, MINUTE, (left) => window.scindo.bodies()[0].lipTriangles < left, left);
  }
  await until(page, "nothing is left to be undone", MINUTE, () => document.getElementById("undo").disabled);
  await picture(page, "views-9-undone.png");
}

async function changesTheScene(page) {
  const choice = page.locator("#scene-choice");
  hold((await choice.inputValue()) === "views" && (await choice.locator("option").count()) > 30, "the scene that runs is chosen among those that ship");
  await choice.selectOption("kidney");
  await until(page, "the menu says what the scene shows", MINUTE, () => /kidney/.test(document.querySelector("#params > p").textContent));
  await until(page, "another scene is drawn", MINUTE, () => window.scindo.bodies().length === 1 && window.scindo.bodies()[0].id === "kidney" && window.scindo.bodies()[0].vertices > 0);
  await until(page, "the page is live again", MINUTE, () => document.getElementById("link").dataset.state === "live");
  await picture(page, "views-10-kidney.png");
}

async function saysThatThereIsNoWebGl() {
  const blind = await chromium.launch({ ...LAUNCH, args: [...LAUNCH.args.filter((flag) => !flag.includes("swiftshader")), "--disable-3d-apis"] });
  try {
    const page = await blind.newPage({ viewport: { width: 800, height: 600 } });
    await page.goto(url);
    await until(page, "a browser without WebGL is told so", MINUTE, () => /needs WebGL 2/.test(document.getElementById("overlay").textContent));
    await picture(page, "views-7-no-webgl.png");
  } finally {
    await blind.close();
  }
}
