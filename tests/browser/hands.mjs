// Two people, two pages: one holds and lifts the lip of a slit with forceps, the other cuts on below it. Works
// on a running hands.toml.
//
//   node hands.mjs URL
//
// All motion is paced by simulated time, so the test does not depend on how fast the machine is. The environment:
// check.mjs.
import { LAUNCH, MINUTE, chromium, hold, picture, run, until, watch } from "./check.mjs";

const url = process.argv[2] ?? "http://127.0.0.1:8080";
/** Longest time for a second of simulation [ms]. */
const SLOWEST = 2 * MINUTE;
/** Where the forceps take hold of the upper edge, and where they lift it to [m]. */
const EDGE_M = [0, 0.008, 0.05], LIFTED_M = [0, 0.0125, 0.0555];

// A browser each: a page behind another one would not be drawn.
const browsers = [await chromium.launch(LAUNCH), await chromium.launch(LAUNCH)];
await run(async () => {
  const [left, right] = [await open(browsers[0], "left"), await open(browsers[1], "right")];
  await holdsTheLip(left);
  const lifted = await liftsTheLip(left);
  await bothSeeTheForce(left, right);
  await cutsOnBelow(left, right);
  await stillHolds(left, lifted);
  await bothSeeTheForce(left, right);
  await letsGo(left);
}, () => Promise.all(browsers.map((browser) => browser.close())));

async function open(browser, name) {
  const page = await browser.newPage({ viewport: { width: 960, height: 640 } });
  watch(page);
  await page.goto(url);
  await until(page, `the ${name} page shows the sheet and its slit`, MINUTE, () => {
    const body = window.scindo?.bodies()[0];
    return body?.vertices > 0 && body.lipTriangles > 0 && window.scindo.counts().pictures > 2;
  });
  return page;
}

function time(page) {
  return page.evaluate(() => window.scindo.bodies()[0].simTimeS);
}

/** Waits until the picture shows the simulation `seconds` further. */
async function simulated(page, seconds) {
  const end = (await time(page)) + seconds;
  await page.waitForFunction((end) => window.scindo.bodies()[0].simTimeS >= end, end, { timeout: SLOWEST, polling: 50 });
}

/**
 * Moves the mouse over the world points from `from` to `to` [m] in `steps` small ones, each of which the simulation has
 * followed for `seconds` before the next: a busy machine makes the hand slow, never jerky.
 */
async function drag(page, from, to, steps, seconds) {
  for (let step = 1; step <= steps; step++) {
    const at = await pixel(page, from.map((x, k) => x + (step / steps) * (to[k] - x)));
    await page.mouse.move(at.x, at.y);
    await simulated(page, seconds);
  }
}

function pixel(page, point) {
  return page.evaluate((point) => window.scindo.project(point), point);
}

/** The tool of this page, or null. */
function own(page) {
  return page.evaluate(() => window.scindo.tools().find((tool) => tool.own) ?? null);
}

function size(v) {
  return Math.hypot(...v);
}

/** Mean place of the upper edge between the jaws [m]. */
function edge(page) {
  return page.evaluate(([, y, z]) => {
    const x = window.scindo.positions("sheet");
    const near = (i) => Math.abs(x[3 * i + 1] - y) < 0.004 && x[3 * i + 2] > z - 0.0005;
    const chosen = window.scindoEdge ??= [...Array(x.length / 3).keys()].filter(near);
    return [0, 1, 2].map((k) => chosen.reduce((sum, i) => sum + x[3 * i + k], 0) / chosen.length);
  }, EDGE_M);
}

/** The jaws close on the edge, one on either side of the sheet. */
async function holdsTheLip(page) {
  await page.evaluate(() => window.scindo.camera([0.01, -0.12, 0.15], [0, 0.005, 0.04]));
  await page.keyboard.press("4");
  await page.evaluate(() => window.scindo.depth(0.16));
  await simulated(page, 0.1);
  await edge(page);
  const at = await pixel(page, EDGE_M);
  await page.mouse.move(at.x, at.y);
  await until(page, "the server knows the forceps", MINUTE, () => window.scindo.tools().some((tool) => tool.own));
  await picture(page, "hands-1-open.png");
  await page.mouse.down();
  // A machine that draws no picture for a while: the jaws wait for the hand to arrive.
  await page.evaluate(() => { for (const start = performance.now(); performance.now() < start + 700;); });
  await simulated(page, 0.8);
  await until(page, "the jaws hold tissue", SLOWEST, () => {
    const tool = window.scindo.tools().find((tool) => tool.own);
    return tool?.held && tool.closed > 0.05;
  });
  const tool = await own(page);
  hold(tool.closed < 0.95, `the sheet keeps the jaws apart (closed by ${tool.closed.toFixed(2)})`);
  await picture(page, "hands-2-held.png");
}

/** Pulls the lip up and aside; the jaws stay closed when the button is released. Returns where it is then [m]. */
async function liftsTheLip(page) {
  const before = await edge(page);
  await drag(page, EDGE_M, LIFTED_M, 28, 0.06);
  await page.keyboard.press("k");
  await page.mouse.up();
  await simulated(page, 0.4);
  const tool = await own(page), after = await edge(page);
  hold(tool.held !== null && size(tool.forceN) > 0.02, `the jaws hold on and feel the tissue (${size(tool.forceN).toFixed(3)} N)`);
  const [, aside, up] = after.map((x, k) => 1e3 * (x - before[k]));
  hold(up > 1.5 && aside > 1.5, `the lip is lifted (by ${up.toFixed(1)} mm, and ${aside.toFixed(1)} mm aside)`);
  await picture(page, "hands-3-lifted.png");
  return after;
}

/** The force on the forceps stands in both pages. */
async function bothSeeTheForce(left, right) {
  const id = (await own(left)).id;
  for (const [page, name] of [[left, "own"], [right, "other"]]) {
    await until(page, `the ${name} page tells the force on the forceps`, SLOWEST, (id) => {
      const tool = window.scindo.tools().find((tool) => tool.id === id);
      return tool && Math.hypot(...tool.forceN) > 0.02;
    }, id);
  }
}

/** A blade cuts from below into the slit; lips grow in both pages. */
async function cutsOnBelow(left, page) {
  const lips = (page) => page.evaluate(() => {
    const { epoch, lipTriangles } = window.scindo.bodies()[0];
    return { epoch, lipTriangles, area: window.scindo.lipArea("sheet") };
  });
  const before = await lips(page);
  await page.evaluate(() => window.scindo.camera([0.16, -0.03, 0.045], [0, 0, 0.027]));
  await page.keyboard.press("3");
  await simulated(page, 0.1);
  const along = (z) => [0.002, 0.001, z];
  const start = await pixel(page, along(0.012));
  await page.mouse.move(start.x, start.y);
  await until(page, "the server knows the blade", MINUTE, () => window.scindo.tools().some((tool) => tool.own));
  await page.mouse.down();
  await simulated(page, 0.3);
  await drag(page, along(0.012), along(0.022), 14, 0.06);
  const blade = (await own(page)).id;
  await until(left, "the other page sees the blade cut", SLOWEST, (id) => window.scindo.tools().some((tool) => tool.id === id && !tool.own && tool.mode === 4), blade);
  await picture(page, "hands-4-cutting.png");
  await drag(page, along(0.022), along(0.034), 16, 0.06);
  await page.mouse.up();
  let after = await lips(page);
  for (let epoch = -1; epoch !== after.epoch; after = await lips(page)) {
    epoch = after.epoch;
    await simulated(page, 0.5);
  }
  const grown = `${before.lipTriangles} to ${after.lipTriangles} wound triangles, epoch ${before.epoch} to ${after.epoch}`;
  hold(after.epoch > before.epoch && after.lipTriangles > before.lipTriangles, `the cut goes on (${grown})`);
  hold(after.area > 1.4 * before.area, `its lips grow (${(1e4 * before.area).toFixed(2)} to ${(1e4 * after.area).toFixed(2)} cm²)`);
  await until(left, "the other page shows the same cut", SLOWEST, (after) => {
    const { epoch, lipTriangles } = window.scindo.bodies()[0];
    return epoch === after.epoch && lipTriangles === after.lipTriangles;
  }, after);
  await page.keyboard.press("o");
  await picture(page, "hands-5-cut.png");
}

/** The cut has let the lip go further with the hand, or has left it where it was. */
async function stillHolds(page, lifted) {
  const tool = await own(page), height = await page.evaluate(() => window.scindo.bodies()[0].max[2]);
  hold(tool?.held != null && size(tool.forceN) > 0.02, "the forceps held on all the while");
  hold(height > lifted[2] - 0.001, `and the lip is still up (at ${(1e3 * height).toFixed(1)} mm)`);
  await picture(page, "hands-6-both.png");
}

async function letsGo(page) {
  await page.keyboard.press("k");
  await until(page, "jaws that open let go", SLOWEST, () => !window.scindo.tools().some((tool) => tool.own && tool.held));
}
