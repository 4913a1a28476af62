// Drives the viewer page of a running demonstration in headless Chromium and holds what it must show.
//
//   node viewer.mjs URL
//
// Prints one line per check and a JSON summary. The environment: check.mjs.
import { mkdtempSync, rmSync } from "node:fs";
import os from "node:os";
import path from "node:path";

import { LAUNCH, MINUTE, artifacts, chromium, hold, picture, run, until, watch } from "./check.mjs";

const url = process.argv[2] ?? "http://127.0.0.1:8080";
const profile = mkdtempSync(path.join(os.tmpdir(), "scindo-browser-"));

// SwiftShader on a busy two-core machine draws 6 to 20 pictures per second and takes seconds to start.
const summary = { url };
const context = await chromium.launchPersistentContext(profile, { ...LAUNCH, viewport: { width: 1280, height: 720 } });
await run(async () => {
  const page = await openPage();
  await bodyIsVisible(page);
  await bodyDeforms(page);
  await messagesFlow(page);
  await incisionOpens(page);
  await incisionIsCurved(page);
  await mouseTouches(page);
  await lateJoinerSeesTheSame(page);
  await fromCloserBy(page);
}, async () => {
  await context.close();
  rmSync(profile, { recursive: true, force: true });
  console.log(JSON.stringify(summary));
});

/** Opens the page and waits for the first surface. */
async function openPage() {
  const health = await (await fetch(new URL("/healthz", url))).json();
  hold(health.ok && health.page === "built", `the viewer is healthy and its page was built (${JSON.stringify(health)})`);
  const page = await context.newPage();
  watch(page);
  await page.goto(url);
  await until(page, "a surface arrives and is drawn", MINUTE, () => {
    const hooks = window.scindo;
    return hooks && hooks.bodies().length > 0 && hooks.counts().pictures > 2 && hooks.bodies().every((b) => b.vertices > 0);
  });
  summary.renderer = await page.evaluate(() => window.scindo.renderer());
  await reset(page);
  await until(page, "a reset makes the body whole", MINUTE, () => window.scindo.bodies().every((b) => b.lipTriangles === 0));
  return page;
}

/** Back to the start; where there are cuts the button asks once more. */
async function reset(page) {
  await page.click("#reset");
  if (await page.evaluate(() => document.getElementById("reset").classList.contains("sure"))) await page.click("#reset");
}

/** Pixels of tissue: reddish, away from the grey of ground and panel. */
async function bodyIsVisible(page) {
  const tissue = await coloured(page, "tissue", 15_000, MINUTE, "view-1-open.png");
  summary.tissuePixels = tissue;
  hold(tissue >= 15_000, `the body is visible (${tissue} tissue pixels)`);
}

/** Some vertex moves by more than 0.2 mm relative to the first frame seen. */
async function bodyDeforms(page) {
  const id = await page.evaluate(() => window.scindo.bodies()[0].id);
  await page.evaluate((id) => { window.scindoTest = { epoch: window.scindo.bodies()[0].epoch, x: window.scindo.positions(id) }; }, id);
  const moved = await until(page, "the body deforms", MINUTE, (id) => {
    const start = window.scindoTest, x = window.scindo.positions(id);
    if (x.length !== start.x.length) {
      window.scindoTest = { x };
      return false;
    }
    let most = 0;
    for (let i = 0; i < x.length; i++) most = Math.max(most, Math.abs(x[i] - start.x[i]));
    return most > 2e-4 && most;
  }, id);
  summary.movedM = moved;
}

/** Messages and pictures go on and on, messages with the simulation; how fast is the machine's affair, and told. */
async function messagesFlow(page) {
  const sample = () => page.evaluate(() => ({ at: performance.now(), simulated: window.scindo.stats()?.simTimeS ?? NaN, ...window.scindo.counts() }));
  await until(page, "statistics arrive", MINUTE, () => Boolean(window.scindo.stats()));
  const a = await sample();
  await until(page, "125 messages arrive and 15 pictures are drawn", MINUTE, (a) => {
    const counts = window.scindo.counts();
    return counts.messages >= a.messages + 125 && counts.pictures >= a.pictures + 15;
  }, a);
  const b = await sample();
  const rate = (key) => (1000 * (b[key] - a[key])) / (b.at - a.at);
  const perSimulated = (b.messages - a.messages) / (b.simulated - a.simulated);
  hold(perSimulated >= 25, `at least 25 messages arrive per simulated second (${perSimulated.toFixed(1)})`);
  Object.assign(summary, { messagesPerS: rate("messages"), framesPerS: rate("frames"), picturesPerS: rate("pictures") });
}

/** Lips appear, their number or epoch grows, and they gape: wound pixels are seen. */
async function incisionOpens(page) {
  const lips = () => page.evaluate(() => {
    const body = window.scindo.bodies()[0];
    return { epoch: body.epoch, lipTriangles: body.lipTriangles, areaM2: window.scindo.lipArea(body.id) };
  });
  // A busy machine may show the blade's way in so few pictures that the pause comes when the incision is done.
  let first = null, marks = 0, grows = false;
  for (let attempt = 0; attempt < 4 && !(marks > 0 && grows); attempt++) {
    if (attempt > 0) await reset(page);
    await until(page, "an incision begins", 4 * MINUTE, (epoch) => {
      const body = window.scindo.bodies()[0];
      return body.lipTriangles > 0 && body.epoch !== epoch;
    }, first?.epoch ?? -1);
    await page.click("#pause");
    await holdsStill(page, "the simulation pauses within the cut");
    first = await lips();
    marks = await page.evaluate(() => window.scindo.bodies()[0].marks);
    await picture(page, "view-2-cut.png");
    await page.click("#pause");
    await until(page, "the simulation goes on within the cut", MINUTE, () => !window.scindo.paused());
    grows = await until(page, "the incision grows, or the blade is done", 4 * MINUTE, (first) => {
      const body = window.scindo.bodies()[0];
      if (body.lipTriangles > first.lipTriangles || body.epoch > first.epoch) return "grows";
      return window.scindo.tools().every((tool) => tool.mode !== 4) && "done";
    }, first) === "grows";
  }
  hold(marks > 0, `the line from the wound to the blade is drawn (${marks} parts)`);
  hold(grows, "the incision grows");
  const wound = await coloured(page, "wound", 300, 2 * MINUTE, "view-3-open.png");
  Object.assign(summary, { lips: await lips(), woundPixels: wound });
  hold(wound >= 300, `the incision opens to the eye (${wound} wound pixels)`);
}

/**
 * When the blade has left, the wound is an arc that rises over its chord by at least a sixth of it (the arc
 * through the mean places of the lips in its three thirds; a flat one has 4/9 of its rise between them).
 * A close look is kept.
 */
async function incisionIsCurved(page) {
  await until(page, "the blade is done", 4 * MINUTE, () => window.scindo.tools().every((tool) => tool.mode !== 4));
  const shape = () => page.evaluate(() => {
    const c = window.scindo.lipCenters(window.scindo.bodies()[0].id), n = c.length / 3;
    let ends = [0, 0], chord = 0;
    for (let i = 0; i < n; i++) {
      for (let j = 0; j < i; j++) {
        const d = Math.hypot(c[3 * i] - c[3 * j], c[3 * i + 1] - c[3 * j + 1]);
        if (d > chord) [ends, chord] = [[3 * i, 3 * j], d];
      }
    }
    const [a, b] = ends, u = [(c[b] - c[a]) / chord, (c[b + 1] - c[a + 1]) / chord];
    const thirds = [[0, 0], [0, 0], [0, 0]];
    for (let k = 0; k < c.length; k += 3) {
      const [x, y] = [c[k] - c[a], c[k + 1] - c[a + 1]];
      const third = thirds[Math.min(2, Math.max(0, Math.floor((3 * (x * u[0] + y * u[1])) / chord)))];
      third[0] += x * u[1] - y * u[0];
      third[1] += 1;
    }
    const [first, middle, last] = thirds.map(([sum, count]) => sum / Math.max(1, count));
    return { chordM: chord, risesM: (9 / 4) * Math.abs(middle - (first + last) / 2) };
  });
  let arc = await shape();
  for (const end = Date.now() + MINUTE; !(arc.risesM > arc.chordM / 6) && Date.now() < end; arc = await shape()) {
    await page.waitForTimeout(500);
  }
  const { position, target } = await page.evaluate(() => window.scindo.cameraState());
  await page.evaluate(() => window.scindo.camera([0.085, -0.085, 0.165], [0.022, -0.006, 0.045]));
  const wound = await coloured(page, "wound", 5000, MINUTE, "view-3-wound.png");
  await page.evaluate(([p, t]) => window.scindo.camera(p, t), [position, target]);
  Object.assign(summary, { arc, woundPixelsClose: wound });
  hold(arc.risesM > arc.chordM / 6, `the incision is curved (${(1e3 * arc.chordM).toFixed(0)} mm long, rises by ${(1e3 * arc.risesM).toFixed(1)} mm)`);
  hold(wound >= 5000, `the wound is seen from close by (${wound} wound pixels)`);
}

/** Pressing with the mouse gives a contact force; letting go ends it. */
async function mouseTouches(page) {
  await page.keyboard.press("1");
  const force = await pressSomewhere(page);
  summary.mouseForceN = force;
  hold(force > 0.005, `the mouse tool feels the tissue (${force.toFixed(3)} N)`);
  await picture(page, "view-4-mouse.png");
  await page.mouse.up();
  await until(page, "the force ends when the mouse lets go", MINUTE, () => window.scindo.contactForceN() < 0.005);
  await page.keyboard.press("o");
}

/** Presses at skin seen in the picture, here and there, until a force comes back; leaves the button down. */
async function pressSomewhere(page) {
  for (const [u, v] of [[0.38, 0.45], [0.3, 0.5], [0.45, 0.55], [0.38, 0.6], [0.5, 0.4], [0.25, 0.45]]) {
    const at = { x: 1280 * u, y: 720 * v };
    const hit = await page.evaluate(({ x, y }) => window.scindo.surfaceAt(x, y), at);
    if (!hit || hit.tag !== 0) continue;
    await page.mouse.move(at.x, at.y);
    await until(page, "the server knows the tool of the mouse", MINUTE, () => window.scindo.tools().some((tool) => tool.own));
    await page.mouse.down();
    for (let i = 0; i < 100; i++) {
      await page.mouse.move(at.x + 8 * Math.sin(i / 3), at.y + 8 * Math.cos(i / 3));
      await page.waitForTimeout(150);
      const force = await page.evaluate(() => window.scindo.contactForceN());
      if (force > 0.005) return force;
    }
    await page.mouse.up();
  }
  return 0;
}

/** Paused, a page that opens now shows epoch, counts, positions and tools of the one that was there before. */
async function lateJoinerSeesTheSame(page) {
  await page.click("#pause");
  await holdsStill(page, "the simulation pauses");
  const seen = () => {
    const bodies = window.scindo.bodies().map(({ id, epoch, vertices, triangles, lipTriangles, marks }) => ({ id, epoch, vertices, triangles, lipTriangles, marks }));
    return { bodies, x: window.scindo.positions(bodies[0].id) };
  };
  const scripted = (tools) => tools.filter((tool) => tool.owner === "script").map((tool) => tool.id).sort().join(" ");
  const before = await page.evaluate(seen);
  // A tool that fell silent would be gone from the page by then.
  await page.waitForTimeout(2000);
  await until(page, "tools are still told while nothing moves", MINUTE, () => window.scindo.tools().some((tool) => tool.owner === "script"));
  const tools = scripted(await page.evaluate(() => window.scindo.tools()));
  await page.reload();
  await until(page, "the page that opened late gets the surface", MINUTE, () => window.scindo?.bodies().some((b) => b.vertices > 0));
  await holdsStill(page, "the page that opened late shows the last step");
  const after = await page.evaluate(seen);
  hold(JSON.stringify(before.bodies) === JSON.stringify(after.bodies), `a late page shows the same surface (${JSON.stringify(after.bodies)})`);
  const same = before.x.length === after.x.length && before.x.every((x, i) => x === after.x[i]);
  hold(same, "positions agree to the last bit");
  summary.lateJoin = after.bodies;
  await until(page, "the page that opened late gets the tools", MINUTE, (count) => window.scindo.tools().filter((tool) => tool.owner === "script").length >= count, tools.split(" ").length);
  const late = scripted(await page.evaluate(() => window.scindo.tools()));
  hold(tools !== "" && late === tools, `a late page shows the tools (${late || "none"}; there were ${tools})`);
  await picture(page, "view-5-late.png");
  await page.click("#pause");
  await until(page, "the simulation goes on", MINUTE, () => !window.scindo.paused());
}

/** The open incision in full quality, a little closer: the picture of the README. */
async function fromCloserBy(page) {
  await page.goto(new URL("?quality=full", url).href);
  await until(page, "a picture in full quality", MINUTE, () => window.scindo?.bodies().some((b) => b.vertices > 0) && window.scindo.counts().pictures > 4);
  await page.evaluate(() => {
    const { position: p, target: t } = window.scindo.cameraState();
    window.scindo.camera([0, 1, 2].map((i) => t[i] + 0.86 * (p[i] - t[i]) + (i === 2 ? 0.02 : 0)), t);
  });
  const pictures = await page.evaluate(() => window.scindo.counts().pictures);
  await until(page, "pictures from closer by", MINUTE, (pictures) => window.scindo.counts().pictures > pictures + 8, pictures);
  await picture(page, "view-6-picture.png");
}

/**
 * Waits until the simulation is paused and its last step has arrived and was drawn. The statistics name that step;
 * the first ones that say "paused" may still have been made beside it.
 */
async function holdsStill(page, words) {
  await page.evaluate(() => { delete window.scindoStill; });
  await until(page, words, MINUTE, () => {
    const { stats, paused, bodies } = window.scindo;
    if (!stats() || !paused()) return false;
    window.scindoStill ??= stats().seq;
    const step = Number(stats().simStep);
    return stats().seq > window.scindoStill && bodies().length > 0 && bodies().every((body) => body.simStep === step);
  });
  await page.evaluate(() => new Promise((drawn) => requestAnimationFrame(() => requestAnimationFrame(drawn))));
}

/** Looks again until there are so many pixels of a kind, for a while; how many there are at last. */
async function coloured(page, kind, least, patience, name) {
  const end = Date.now() + patience;
  for (;;) {
    const count = (await colours(page, name))[kind];
    if (count >= least || Date.now() > end) return count;
    await page.waitForTimeout(500);
  }
}

/** Counts tissue and wound pixels left of the panel in a screenshot, which is kept. */
async function colours(page, name) {
  const png = await page.screenshot({ path: path.join(artifacts, name) });
  const blank = await context.newPage();
  const counts = await blank.evaluate(async (base64) => {
    const image = new Image();
    image.src = `data:image/png;base64,${base64}`;
    await image.decode();
    const canvas = new OffscreenCanvas(image.width, image.height);
    const draw = canvas.getContext("2d");
    draw.drawImage(image, 0, 0);
    const { data, width, height } = draw.getImageData(0, 0, image.width, image.height);
    let tissue = 0, wound = 0;
    for (let y = 50; y < height - 90; y++) {
      for (let x = 0; x < width - 310; x++) {
        const i = 4 * (y * width + x);
        const r = data[i], g = data[i + 1], b = data[i + 2];
        if (r > 60 && r > 1.25 * g) tissue += 1;
        // Wound red has hardly any green, and more blue than green; skin has more green than blue.
        if (r > 70 && r > 3.2 * g && b > 1.05 * g) wound += 1;
      }
    }
    return { tissue, wound };
  }, png.toString("base64"));
  await blank.close();
  return counts;
}
