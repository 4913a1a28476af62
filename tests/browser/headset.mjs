// A person in a headset, which an emulator plays: enters, sees the body on the table, presses and cuts it with the
// right hand, holds it with the left, feels pulses, and leaves. Works on a running people.toml.
//
//   node headset.mjs URL
//
// The environment: check.mjs. The emulator (iwer) stands in for the browser's own WebXR.
import path from "node:path";
import { LAUNCH, MINUTE, chromium, hold, modules, picture, run, until, watch } from "./check.mjs";

const url = process.argv[2];
const browser = await chromium.launch(LAUNCH);
await run(async () => {
  await aBrowserWithoutOneHasNoButton();
  const page = await browser.newPage({ viewport: { width: 1000, height: 700 } });
  watch(page);
  const asked = [];
  page.on("request", (request) => asked.push(new URL(request.url()).pathname));
  await page.addInitScript({ path: path.join(modules, "iwer/build/iwer.min.js") });
  await page.addInitScript(() => {
    window.device = new IWER.XRDevice(IWER.metaQuest3);
    window.device.installRuntime({ forceInstall: true });
    window.device.stereoEnabled = true;
    // The head looks down at the table.
    window.device.position.set(0, 1.5, 0);
    window.device.quaternion.set(-Math.sin(0.35), 0, 0, Math.cos(0.35));
  });
  await page.goto(url);
  await until(page, "the page draws the scene", MINUTE, () => window.scindo?.bodies()[0]?.vertices > 0 && window.scindo.counts().pictures > 2);
  hold(!asked.some((name) => name.includes("xr-")), "nothing of the headset is loaded yet");
  await page.click("#headset");
  await until(page, "the headset shows pictures", MINUTE, () => window.scindo.headset()?.pictures > 3);
  hold(asked.some((name) => name.includes("xr-")), "its code came when it was asked for");
  await bothHandsAreTools(page);
  await theRightHandPresses(page);
  await theRightHandCuts(page);
  await theLeftHandHolds(page);
  await page.evaluate(() => window.device.activeSession?.end());
  await until(page, "the page draws again after it was left", MINUTE, () => window.scindo.headset() === null);
  await until(page, "and both tools are gone", MINUTE, () => !window.scindo.tools().some((tool) => tool.own));
  await picture(page, "headset-4-left.png");
}, () => browser.close());

async function aBrowserWithoutOneHasNoButton() {
  const page = await browser.newPage();
  await page.goto(url);
  await until(page, "a browser without a headset has no button for it", MINUTE, () => window.scindo && document.getElementById("headset").hidden);
  await page.close();
}

/**
 * Moves a hand so that the tip of its tool comes to a place beside the centre of the body, given as fractions of its
 * radius along the room's axes: x to the right, y up, z towards the user. The hand points down.
 */
function reach(page, hand, place) {
  return page.evaluate(([hand, [x, y, z]]) => {
    const controller = window.device.controllers[hand], half = Math.SQRT1_2, room = 0.22, length = 0.1;
    // Turned about x by -90 degrees, the ray points down and the tip lies below the hand.
    controller.quaternion.set(-half, 0, 0, half);
    controller.position.set(room * x, 1.05 + room * y + length, -0.5 + room * z);
  }, [hand, place]);
}

function press(page, hand, button, value) {
  return page.evaluate(([hand, button, value]) => window.device.controllers[hand].updateButtonValue(button, value), [hand, button, value]);
}

/** Goes on by some pictures of the headset. */
async function pictures(page, count) {
  const end = (await page.evaluate(() => window.scindo.headset().pictures)) + count;
  await page.waitForFunction((end) => window.scindo.headset().pictures >= end, end, { timeout: 2 * MINUTE });
}

async function bothHandsAreTools(page) {
  await reach(page, "left", [-0.5, 0.8, 0]);
  await reach(page, "right", [0.5, 0.8, 0]);
  await until(page, "both controllers are tools on the server", MINUTE, () => window.scindo.tools().filter((tool) => tool.own).length === 2);
  const { hands, bounds } = await page.evaluate(() => ({ hands: window.scindo.headset().hands, bounds: window.scindo.bounds() }));
  const right = hands.find((hand) => !hand.left).tip, left = hands.find((hand) => hand.left).tip;
  hold(right[0] > bounds.min[0] && right[2] > bounds.max[2] && left[0] < right[0], `hands above the body stand above it in the scene (${right.map((x) => x.toFixed(3))})`);
  await picture(page, "headset-1-hands.png");
}

async function theRightHandPresses(page) {
  for (const height of [0.6, 0.5, 0.4, 0.3, 0.2]) {
    await reach(page, "right", [0.25, height, 0]);
    await pictures(page, 3);
  }
  await until(page, "pressed tissue pushes back", MINUTE, () => window.scindo.contactForceN() > 0.02);
  await until(page, "and the controller pulses", MINUTE, () => window.scindo.headset().hands.find((hand) => !hand.left).pulses > 2);
  await picture(page, "headset-2-pressed.png");
  await reach(page, "right", [0.25, 0.9, 0]);
  await pictures(page, 3);
}

async function theRightHandCuts(page) {
  for (let k = 0; k < 2; k++) {
    for (const value of [1, 0]) {
      await press(page, "right", "squeeze", value);
      await pictures(page, 3);
    }
  }
  hold(await page.evaluate(() => window.scindo.headset().hands.find((hand) => !hand.left).grip === "cut"), "the grip button changes the tool");
  await reach(page, "right", [-0.7, 0.0, 0]);
  await pictures(page, 4);
  await press(page, "right", "trigger", 1);
  for (let k = 0; k <= 24; k++) {
    await reach(page, "right", [-0.7 + 0.06 * k, 0.0, 0]);
    await pictures(page, 2);
  }
  await press(page, "right", "trigger", 0);
  await until(page, "the trigger cuts where the blade is drawn", MINUTE, () => window.scindo.bodies()[0].lipTriangles > 10);
  await reach(page, "right", [0.5, 0.9, 0]);
  await pictures(page, 3);
  await picture(page, "headset-3-cut.png");
}

async function theLeftHandHolds(page) {
  await reach(page, "left", [-0.2, 0.28, 0.3]);
  await pictures(page, 4);
  await press(page, "left", "trigger", 1);
  await pictures(page, 4);
  for (const height of [0.32, 0.38, 0.45]) {
    await reach(page, "left", [-0.2, height, 0.3]);
    await pictures(page, 3);
  }
  await until(page, "the left hand holds and lifts the tissue", MINUTE, () => window.scindo.tools().some((tool) => tool.id.endsWith("-left") && tool.held !== null && Math.hypot(...tool.forceN) > 0.02));
  await press(page, "left", "trigger", 0);
}
