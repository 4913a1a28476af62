// Several people at one scene: two pages and a haptic client see each other's names, roles and tools; a phone touches
// the tissue with one finger and zooms with two; all of them survive a restart of the server. Starts everything itself.
//
//   node people.mjs FOLDER-OF-PROGRAMS SCENE SERVER-PORT PAGE-PORT
//
// The environment: check.mjs.
import { spawn } from "node:child_process";
import { createWriteStream } from "node:fs";
import path from "node:path";
import { LAUNCH, MINUTE, artifacts, chromium, hold, picture, run, until, watch } from "./check.mjs";

const [, , programs, scene, port, web] = process.argv;
const endpoint = `tcp/127.0.0.1:${port}`, url = `http://127.0.0.1:${web}`;
const started = new Set();

const browser = await chromium.launch(LAUNCH), second = await chromium.launch(LAUNCH);
let server = start("scindo", ["run", scene, "--listen", endpoint]);
// A viewer of its own, which stays when the server goes.
start("scindo-view", ["--connect", endpoint, "--listen", `127.0.0.1:${web}`]);
await run(async () => {
  const anna = await open(browser, "?name=Anna");
  const other = await open(second, "");
  await bothAreListed(anna, other);
  await aToolHasItsHolder(anna, other);
  await aDeviceIsSeen(anna, other);
  await aPhoneTouches(other);
  await aRestartIsSurvived(anna, other);
  await other.close();
  await until(anna, "who left is no longer listed", MINUTE, () => window.scindo.people().length === 1);
}, async () => {
  await Promise.all([browser.close(), second.close()]);
  for (const child of started) child.kill("SIGTERM");
  await Promise.all([...started].map((child) => ended(child)));
});

function start(program, options) {
  const child = spawn(path.join(programs, program), options, { stdio: ["ignore", "pipe", "pipe"] });
  const log = createWriteStream(path.join(artifacts, `people-${program}.log`), { flags: "a" });
  child.stdout.pipe(log, { end: false });
  child.stderr.pipe(log, { end: false });
  started.add(child);
  child.on("exit", () => started.delete(child));
  return child;
}

function ended(child) {
  return child.exitCode !== null || child.signalCode !== null ? Promise.resolve() : new Promise((done) => child.on("exit", done));
}

async function open(browser, query) {
  const page = await browser.newPage({ viewport: { width: 1200, height: 800 } });
  watch(page);
  for (let tries = 0; ; tries++) {
    try {
      await page.goto(url + query);
      break;
    } catch (error) {
      if (tries === 100) throw error;
      await new Promise((done) => setTimeout(done, 200));
    }
  }
  await until(page, `the page ${query} draws the scene`, MINUTE, () => window.scindo?.bodies()[0]?.vertices > 0 && window.scindo.counts().pictures > 2);
  return page;
}

async function bothAreListed(anna, other) {
  await until(anna, "a name of the address is shown", MINUTE, () => document.getElementById("people").textContent.includes("Anna (you)"));
  await until(other, "the other page reads it", MINUTE, () => window.scindo.people().some((one) => one.name === "Anna" && !one.own && one.role === "teacher"));
  await other.click("#view-toggle");
  await other.fill("#name", "  <b>Änne</b>\u202e ");
  await other.keyboard.press("Enter");
  await until(anna, "a name typed into the page comes without tricks", MINUTE, () => window.scindo.people().some((one) => one.name === "<b>Änne</b>"));
  hold(await anna.evaluate(() => document.querySelector("#people b") === null), "and stays text");
  await other.fill("#name", "Änne");
  await other.keyboard.press("Enter");
  await other.click("#view-toggle");
  await until(anna, "it may be changed", MINUTE, () => window.scindo.people().some((one) => one.name === "Änne"));
  hold(await other.evaluate(() => localStorage.getItem("scindo-name") === "Änne" && document.body.dataset.hand === "orbit"), "the browser keeps it, and typing it chose no tool");
  const colours = await anna.evaluate(() => window.scindo.people().map((one) => one.colour));
  hold(new Set(colours).size === colours.length, `each has a colour (${colours.join(" ")})`);
}

/** The middle of the body in the picture. */
function middle(page) {
  return page.evaluate(() => {
    const { min, max } = window.scindo.bounds();
    return window.scindo.project(min.map((low, k) => 0.5 * (low + max[k])));
  });
}

async function aToolHasItsHolder(anna, other) {
  await other.keyboard.press("1");
  const at = await middle(other);
  await other.mouse.move(at.x, at.y);
  await other.mouse.down();
  await until(anna, "a tool in another hand has the name and colour of its holder", MINUTE, () => {
    const tool = window.scindo.tools().find((tool) => tool.holder === "Änne");
    const tag = [...document.querySelectorAll("#labels .holder")].find((node) => node.textContent === "Änne" && !node.hidden);
    return tool && !tool.own && Math.hypot(...tool.forceN) > 0.01 && tag?.style.getPropertyValue("--of").startsWith("#");
  });
  hold(await other.evaluate(() => window.scindo.tools().every((tool) => tool.holder === "")), "its own page gives it no tag");
  await picture(anna, "people-1-holder.png");
  await other.mouse.up();
  await other.keyboard.press("0");
}

async function aDeviceIsSeen(anna, other) {
  const device = start("scindo-haptic", ["--connect", endpoint, "--id", "eva-device", "--name", "Eva", "--tool", "probe", "--seconds", "600"]);
  for (const page of [anna, other]) {
    await until(page, "a haptic client is listed with its name, role and tool", MINUTE, () => {
      const eva = window.scindo.people().find((one) => one.id === "eva-device");
      return eva?.name === "Eva" && eva.role === "haptic" && eva.tools.length === 1;
    });
  }
  await until(anna, "its tool has its name", MINUTE, () => window.scindo.tools().some((tool) => tool.holder === "Eva"));
  await picture(anna, "people-2-device.png");
  device.kill("SIGKILL");
  await until(anna, "a client that was killed is gone", MINUTE, () => !window.scindo.people().some((one) => one.id === "eva-device"));
}

async function aPhoneTouches(keep) {
  const context = await second.newContext({ viewport: { width: 360, height: 640 }, hasTouch: true, isMobile: true, deviceScaleFactor: 2 });
  const page = await context.newPage();
  watch(page);
  await page.goto(`${url}?name=Phone`);
  await until(page, "a phone draws the scene", MINUTE, () => window.scindo?.bodies()[0]?.vertices > 0 && window.scindo.counts().pictures > 2);
  const sideways = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
  hold(sideways <= 0, "nothing lies beyond its small window");
  const hands = await context.newCDPSession(page);
  const touch = (type, points) => hands.send("Input.dispatchTouchEvent", { type, touchPoints: points.map(([x, y], id) => ({ x, y, id })) });
  const eye = () => page.evaluate(() => Math.hypot(...window.scindo.cameraState().position.map((x, k) => x - window.scindo.cameraState().target[k])));
  const place = await middle(page), before = await eye();
  await touch("touchStart", [[place.x - 20, place.y], [place.x + 20, place.y]]);
  for (let k = 1; k <= 12; k++) await touch("touchMove", [[place.x - 20 - 4 * k, place.y], [place.x + 20 + 4 * k, place.y]]);
  await touch("touchEnd", []);
  await page.waitForTimeout(500);
  const after = await eye();
  hold(after < 0.8 * before, `two fingers apart bring the scene nearer (${before.toFixed(3)} to ${after.toFixed(3)} m)`);
  await page.tap("button[data-hand=poke]");
  const at = await middle(page);
  await touch("touchStart", [[at.x, at.y]]);
  for (let k = 1; k <= 6; k++) await touch("touchMove", [[at.x + k, at.y]]);
  await until(page, "one finger presses the tissue", MINUTE, () => window.scindo.contactForceN() > 0.01);
  await picture(page, "people-3-phone.png");
  await touch("touchEnd", []);
  await until(keep, "and the tool is gone when the finger is lifted", MINUTE, () => !window.scindo.tools().some((tool) => tool.holder === "Phone"));
  await context.close();
}

async function aRestartIsSurvived(anna, other) {
  await anna.evaluate(() => window.scindo.camera([0.2, -0.2, 0.25], [0, 0, 0.02]));
  const eye = await anna.evaluate(() => window.scindo.cameraState().position);
  server.kill("SIGKILL");
  await ended(server);
  for (const page of [anna, other]) {
    await until(page, "the page says that the server is unreachable", MINUTE, () => /unreachable/.test(document.getElementById("overlay").textContent) && !document.getElementById("overlay").classList.contains("hidden"));
  }
  await picture(anna, "people-4-no-server.png");
  server = start("scindo", ["run", scene, "--listen", endpoint]);
  for (const page of [anna, other]) {
    await until(page, "it goes on with the server that was started again", 2 * MINUTE, () => document.getElementById("link").dataset.state === "live" && window.scindo.bodies()[0].simTimeS < 60);
  }
  const moved = await anna.evaluate((eye) => Math.hypot(...window.scindo.cameraState().position.map((x, k) => x - eye[k])), eye);
  hold(moved < 1e-6, "the camera stays where it was");
  await until(anna, "and both people are listed again", MINUTE, () => window.scindo.people().some((one) => one.own && one.name === "Anna") && window.scindo.people().some((one) => one.name === "Änne"));
  await other.keyboard.press("1");
  const at = await middle(other);
  await other.mouse.move(at.x, at.y);
  await other.mouse.down();
  await until(anna, "a hand touches the new server's tissue", MINUTE, () => window.scindo.tools().some((tool) => tool.holder === "Änne" && Math.hypot(...tool.forceN) > 0.01));
  await other.mouse.up();
}
