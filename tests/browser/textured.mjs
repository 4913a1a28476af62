// Holds images on skins: each quarter of the image is where its texture coordinates say, before and after a cut, on
// tetrahedra and on octree cells; the saved surface has it too. Looks at a running textured.toml.
//
//   node textured.mjs URL
//
// The environment: check.mjs.
import { readFileSync } from "node:fs";
import path from "node:path";
import { LAUNCH, MINUTE, artifacts, chromium, hold, picture, run, until, watch } from "./check.mjs";

const [, , url] = process.argv;
/** Colours of the quarters of the image, by the parts of its width and height where they lie; rows run upwards. */
const QUARTERS = { blue: [0.25, 0.25], white: [0.75, 0.25], red: [0.25, 0.75], green: [0.75, 0.75] };
const SIDE = 0.1;

const browser = await chromium.launch(LAUNCH);
await run(async () => {
  const page = await browser.newPage({ viewport: { width: 1440, height: 900 } });
  watch(page);
  await page.goto(url);
  await until(page, "three bodies have their images", MINUTE, () => window.scindo?.bodies().length === 3 && window.scindo.bodies().every((b) => b.vertices > 0 && b.textured));
  await page.evaluate(() => window.scindo.camera([0.2, 0.0499, 1.0], [0.2, 0.05, 0.1]));
  await imageIsInPlace(page, "at rest");
  await until(page, "both are cut", MINUTE, () => window.scindo.bodies().slice(0, 2).every((b) => b.lipTriangles > 0) && window.scindo.bodies()[0].simTimeS > 8.2);
  await imageIsInPlace(page, "after a cut");
  await picture(page, "textured.png");
  await savesTheImage(page);
  const late = await browser.newPage({ viewport: { width: 1440, height: 900 } });
  watch(late);
  await late.goto(url);
  await until(late, "a late page gets the images as well", MINUTE, () => window.scindo?.bodies().length === 3 && window.scindo.bodies().every((b) => b.textured));
}, () => browser.close());

/** The quarters as they are seen from above. */
async function imageIsInPlace(page, when) {
  // By then the page has drawn what has arrived.
  await page.waitForTimeout(500);
  for (const [body, left] of [["tets", 0], ["cells", 0.15]]) {
    const places = Object.values(QUARTERS).map(([u, v]) => [left + SIDE * u, SIDE * v, SIDE]);
    const found = (await pixels(page, places)).map(name);
    hold(found.join() === Object.keys(QUARTERS).join(), `${body}: every quarter is in its place ${when} (${found})`);
  }
  const size = SIDE / 2;
  const again = [0.25, 0.75].map((u) => [0.3 + size * u, size * 0.25, SIDE]);
  const found = (await pixels(page, [...again, ...again.map(([x, y, z]) => [x + size, y + size, z])])).map(name);
  hold(found.join() === "blue,white,blue,white", `the pattern is repeated ${when} (${found})`);
}

/** Colours on the screen at points of space. */
async function pixels(page, places) {
  const png = (await page.screenshot()).toString("base64");
  return page.evaluate(async ({ png, places }) => {
    // The page may fetch nothing but its own files.
    const bytes = Uint8Array.from(atob(png), (c) => c.charCodeAt(0));
    const image = await createImageBitmap(new Blob([bytes], { type: "image/png" }));
    const canvas = new OffscreenCanvas(image.width, image.height), context = canvas.getContext("2d");
    context.drawImage(image, 0, 0);
    return places.map((place) => {
      const { x, y } = window.scindo.project(place);
      return [...context.getImageData(Math.round(x), Math.round(y), 1, 1).data.slice(0, 3)];
    });
  }, { png, places });
}

function name([r, g, b]) {
  const most = Math.max(r, g, b), least = Math.min(r, g, b);
  if (least > 0.6 * most) return most > 90 ? "white" : "dark";
  return most === r ? "red" : most === g ? "green" : "blue";
}

async function savesTheImage(page) {
  if (!(await page.isVisible("#tray"))) await page.click("#view-toggle");
  const download = page.waitForEvent("download", { timeout: MINUTE });
  await page.click("#save-surface");
  const file = path.join(artifacts, "textured.glb");
  await (await download).saveAs(file);
  const bytes = readFileSync(file);
  const { images, meshes } = JSON.parse(bytes.toString("utf8", 20, 20 + bytes.readUInt32LE(12)));
  const placed = meshes.every((mesh) => mesh.primitives.some(({ attributes }) => "TEXCOORD_0" in attributes));
  hold(images?.length >= 1 && placed, `the saved surface has ${images?.length} images, and every mesh lies on one`);
}
