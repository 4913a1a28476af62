// Opens a page with line charts (`scindo stress`) and holds that they answer a reader.
//
//   node charts.mjs FILE.html
//
// Prints one line per check. The environment: check.mjs.
import path from "node:path";
import { pathToFileURL } from "node:url";

import { LAUNCH, artifacts, chromium, hold, run, watch } from "./check.mjs";

const browser = await chromium.launch(LAUNCH);
await run(async () => {
  const page = await browser.newPage({ viewport: { width: 1200, height: 900 } });
  watch(page);
  await page.goto(pathToFileURL(path.resolve(process.argv[2])).href);
  const chart = page.locator(".axes:has([data-toggles=kinetic])").first();
  await chart.scrollIntoViewIfNeeded();
  const shown = chart.locator("[data-axes]:not([hidden])");
  const lines = () => shown.locator("path[data-name]").evaluateAll((all) => all.filter((line) => line.style.display !== "none").map((line) => line.dataset.series));
  const all = await lines();
  hold(all.some((series) => series.endsWith("kinetic")) && all.some((series) => series.endsWith("elastic")), `a chart of energies (${all.length} lines)`);

  // The third corner of the first line.
  const corner = await shown.locator("path[data-name]").first().evaluate((line) => {
    const [x, y] = line.getAttribute("d").slice(1).split(/[ML]/)[2].split(" ").map(Number);
    const at = new DOMPoint(x, y).matrixTransform(line.getScreenCTM());
    return { x: at.x, y: at.y, name: line.dataset.name };
  });
  await page.mouse.move(corner.x, corner.y);
  const words = (await page.locator(".tip").textContent()).split("\n");
  hold(words.length === 3 && words[1].startsWith("time") && words.slice(1).every((line) => Number.isFinite(Number(line.split(": ").pop()))), `a line under the pointer tells its name and values ("${words.join(" | ")}")`);
  await page.screenshot({ path: path.join(artifacts, "chart-pointed-at.png") });

  await shown.locator("[data-toggles=elastic]").click();
  hold((await lines()).every((series) => !series.endsWith("elastic")), "the legend switches one energy off for all runs");
  await shown.locator("[data-toggles=elastic]").click();
  const run = (await shown.locator("[data-toggles^=r]").first().getAttribute("data-toggles"));
  await shown.locator(`[data-toggles=${run}]`).click();
  hold((await lines()).every((series) => series.split(" ")[0] !== run), "and both energies of one run");
  await shown.locator(`[data-toggles=${run}]`).click();
  hold((await lines()).length === all.length, "and on again");

  const without = await page.locator(".axes:not(:has([data-axes] ~ [data-axes])) button").count();
  hold(without === 0, "a chart with one kind of axes has no button for others");
  const before = await shown.getAttribute("data-axes");
  await chart.locator("button").click();
  hold((await shown.getAttribute("data-axes")) !== before && (await lines()).length > 0, "a button changes the vertical axis");
  await chart.screenshot({ path: path.join(artifacts, "chart-logarithmic.png") });
}, () => browser.close());
