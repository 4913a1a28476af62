// Opens the page of `scindo accuracy` in headless Chromium and holds that a person can read it.
//
//   node accuracy.mjs FILE.html [CASE]...
//
// Prints one line per check. The environment: check.mjs.
import path from "node:path";
import { pathToFileURL } from "node:url";

import { LAUNCH, artifacts, chromium, hold, run, watch } from "./check.mjs";

const [file, ...cases] = process.argv.slice(2);

const browser = await chromium.launch(LAUNCH);
await run(async () => {
  for (const colorScheme of ["light", "dark"]) {
    const context = await browser.newContext({ viewport: { width: 1200, height: 900 }, colorScheme });
    const page = await context.newPage();
    watch(page);
    const asked = [];
    page.on("request", (request) => { if (!request.url().startsWith("file:")) asked.push(request.url()); });
    await page.goto(pathToFileURL(path.resolve(file)).href);
    if (colorScheme === "light") await isComplete(page);
    await isLegible(page, colorScheme);
    if (colorScheme === "light") await answers(page);
    hold(asked.length === 0, `${colorScheme}: the page asks nobody for anything (${asked.join(", ") || "self-contained"})`);
    await page.screenshot({ path: path.join(artifacts, `accuracy-${colorScheme}.png`), fullPage: true });
    for (const section of await page.$$("section[id]")) {
      const name = await section.getAttribute("id");
      await section.screenshot({ path: path.join(artifacts, `accuracy-${colorScheme}-${name}.png`) });
    }
    await context.close();
  }
  const narrow = await browser.newContext({ viewport: { width: 420, height: 800 } });
  const page = await narrow.newPage();
  await page.goto(pathToFileURL(path.resolve(file)).href);
  const overhang = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
  hold(overhang <= 0, `a narrow window does not scroll sideways (${overhang} px over)`);
  await narrow.close();
}, () => browser.close());

/** Every case has its pictures, a front, a table and a reference. */
async function isComplete(page) {
  const sections = await page.$$eval("section[id]:not(#method)", (all) => all.map((section) => ({
    id: section.id,
    plots: section.querySelectorAll("[data-axes=logarithmic] > svg.plot").length,
    hidden: section.querySelectorAll("[data-axes=linear][hidden] > svg.plot").length,
    marks: section.querySelectorAll("figure [data-axes=logarithmic] .mark").length,
    titled: [...section.querySelectorAll("[data-axes=logarithmic] g:has(> .mark)[data-tip]")].filter((g) => g.dataset.tip.includes("median")).length,
    front: section.querySelectorAll("table.front tbody tr").length,
    ranks: section.querySelector("svg.plot").querySelectorAll("text.rank").length,
    line: section.querySelectorAll("[data-axes=logarithmic] path.front").length,
    failed: section.querySelector("svg.plot").querySelectorAll("g > path.failed").length,
    rows: section.querySelectorAll("table.all tbody tr").length,
    reasons: section.querySelectorAll("table.all td.reason").length,
    reference: section.textContent.includes("Error bar"),
  })));
  for (const name of cases) hold(sections.some((s) => s.id === name), `case ${name} is on the page`);
  for (const s of sections) {
    hold(s.plots === 3 && s.hidden === 3 && s.marks > 6 && s.titled > 3, `${s.id}: three pictures with marks that tell what they are (${s.marks} marks)`);
    hold(s.line >= 1 && s.front >= 1 && s.front === s.ranks, `${s.id}: a Pareto front, drawn and listed (${s.front} points)`);
    // One cross stands in the legend.
    hold(s.reasons === 0 || s.failed >= s.reasons, `${s.id}: every run without result is marked (${s.reasons} of ${s.rows}) and its reason is listed`);
    hold(s.reference, `${s.id}: a reference with its error bar`);
  }
  const method = await page.textContent("#method");
  hold(/Displacement error/.test(method) && /Machine/.test(method) && /commit/i.test(method), "method, machine and commit are named");
}

/** A plot tells what is under the pointer, switches its series and its axes, and prints what is shown. */
async function answers(page) {
  const plot = page.locator("section .axes").first();
  const marks = () => plot.locator("[data-axes]:not([hidden]) g[data-tip]:has(> .mark)");
  const seen = () => marks().evaluateAll((all) => all.filter((g) => g.style.display !== "none").length);
  const tip = page.locator(".tip");
  await plot.scrollIntoViewIfNeeded();
  const best = plot.locator("[data-axes]:not([hidden]) g[data-tip]:has(> .best)").first();
  const { x, y, width, height } = await best.boundingBox();
  await page.mouse.move(x + width / 2 + 3, y + height / 2 + 2);
  const told = await tip.textContent();
  hold(await tip.isVisible() && told === (await best.getAttribute("data-tip")), `a mark under the pointer tells what it is ("${told.split("\n")[0]}")`);
  await page.screenshot({ path: path.join(artifacts, "accuracy-pointed-at.png") });
  await page.mouse.move(2, 2);
  hold(await tip.isHidden(), "the words go with the pointer");

  const all = await seen();
  const key = plot.locator("[data-axes]:not([hidden]) [data-toggles^=c]").first();
  const name = await key.getAttribute("data-toggles");
  const of = await marks().evaluateAll((every, series) => every.filter((g) => g.dataset.series.split(" ").includes(series)).length, name);
  await key.click();
  hold(of > 0 && (await seen()) === all - of && (await key.getAttribute("aria-checked")) === "false", `the legend switches ${of} of ${all} marks off`);

  const before = await marks().first().getAttribute("transform");
  await plot.locator("button").click();
  hold((await marks().first().getAttribute("transform")) !== before && (await seen()) === all - of, "on linear axes the same marks lie elsewhere");
  await isLegible(page, "linear axes");
  await plot.screenshot({ path: path.join(artifacts, "accuracy-linear.png") });
  await page.emulateMedia({ media: "print" });
  hold(await plot.locator("button").isHidden() && (await seen()) === all - of, "print has no button, and shows what is shown");
  await page.emulateMedia({ media: "screen" });
  await plot.locator("button").click();
  await plot.locator("[data-axes]:not([hidden]) [data-toggles^=c]").first().press("Enter");
  hold((await seen()) === all, "the keyboard switches them on again");
}

/** No text of a picture leaves it or covers another; text has contrast; nothing is tiny. */
async function isLegible(page, scheme) {
  const found = await page.evaluate(() => {
    const faults = [];
    const shown = [...document.querySelectorAll("svg.plot")].filter((svg) => !svg.closest("[hidden]"));
    for (const svg of shown) {
      const frame = svg.getBoundingClientRect();
      const written = [...svg.querySelectorAll("text")].filter((text) => text.style.display !== "none");
      const boxes = written.map((text) => ({ text: text.textContent, box: text.getBoundingClientRect() }));
      for (const { text, box } of boxes) {
        if (box.left < frame.left - 1 || box.right > frame.right + 1 || box.top < frame.top - 1 || box.bottom > frame.bottom + 1) {
          faults.push(`"${text}" leaves its picture`);
        }
        if (box.height < 8) faults.push(`"${text}" is ${box.height.toFixed(1)} px high`);
      }
      boxes.forEach((a, i) => boxes.slice(i + 1).forEach((b) => {
        const wide = Math.min(a.box.right, b.box.right) - Math.max(a.box.left, b.box.left);
        const high = Math.min(a.box.bottom, b.box.bottom) - Math.max(a.box.top, b.box.top);
        if (wide > 2 && high > 4) faults.push(`"${a.text}" and "${b.text}" overlap`);
      }));
    }
    const luminance = (colour) => {
      const [r, g, b] = colour.match(/[\d.]+/g).map((c) => (c / 255 <= 0.03928 ? c / 255 / 12.92 : ((c / 255 + 0.055) / 1.055) ** 2.4));
      return 0.2126 * r + 0.7152 * g + 0.0722 * b;
    };
    const ground = luminance(getComputedStyle(document.body).backgroundColor);
    const contrast = (colour) => {
      const [a, b] = [luminance(colour), ground].sort((x, y) => y - x);
      return (a + 0.05) / (b + 0.05);
    };
    for (const element of document.querySelectorAll("p, td, th, h1, h2, h3, dd, dt, figcaption")) {
      const c = contrast(getComputedStyle(element).color);
      if (c < 4.5) faults.push(`${element.tagName} has contrast ${c.toFixed(1)}`);
    }
    for (const text of shown.flatMap((svg) => [...svg.querySelectorAll("text")])) {
      const c = contrast(getComputedStyle(text).fill);
      if (c < 4.5) faults.push(`"${text.textContent}" has contrast ${c.toFixed(1)}`);
    }
    return { faults: [...new Set(faults)], sideways: document.documentElement.scrollWidth - innerWidth };
  });
  hold(found.faults.length === 0, `${scheme}: all text is legible${found.faults.length ? ": " + found.faults.slice(0, 8).join("; ") : ""}`);
  hold(found.sideways <= 0, `${scheme}: the page fits its window`);
}
