// What the browser tests share: the browser, where pictures go, and checks that print a line each.
//
//   SCINDO_TEST_NODE_MODULES   folder with playwright-core (default: node_modules beside this file)
//   SCINDO_TEST_ARTIFACTS      where screenshots go (default: ../artifacts)
//   CHROMIUM                   browser (default: /usr/bin/chromium)
import { createRequire } from "node:module";
import { mkdirSync } from "node:fs";
import path from "node:path";
import { fileURLToPath } from "node:url";

const here = path.dirname(fileURLToPath(import.meta.url));
export const modules = process.env.SCINDO_TEST_NODE_MODULES ?? path.join(here, "node_modules");

export const { chromium } = createRequire(path.join(modules, "anchor.js"))("playwright-core");
export const artifacts = process.env.SCINDO_TEST_ARTIFACTS ?? path.join(here, "../artifacts");
mkdirSync(artifacts, { recursive: true });

export const LAUNCH = {
  executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
  headless: true,
  args: [
    "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--enable-unsafe-swiftshader",
  ],
};
export const MINUTE = 60_000;

let failures = 0;

/** One check, one line. */
export function hold(condition, words) {
  if (!condition) failures += 1;
  console.log(`${condition ? "ok     " : "FAILED "} ${words}`);
}

/** Errors of the page's own scripts fail the test. */
export function watch(page) {
  page.on("pageerror", (error) => { failures += 1; console.error(`FAILED  script error: ${error.message}`); });
}

/** Polls until `check` gives something; its value. Fails the test, with a picture, when the time is over. */
export async function until(page, words, timeout, check, argument) {
  try {
    const handle = await page.waitForFunction(check, argument, { timeout, polling: 200 });
    console.log(`ok      ${words}`);
    return await handle.jsonValue();
  } catch (error) {
    await picture(page, "failed.png").catch(() => {});
    throw new Error(`${words}: not within ${timeout / 1000} s (${error.message.split("\n")[0]})`);
  }
}

export async function picture(page, name) {
  await page.screenshot({ path: path.join(artifacts, name) });
}

/** Runs the checks of `test`, then `close`; ends the process with 0 if all of them held. */
export async function run(test, close) {
  try {
    await test();
  } catch (error) {
    failures += 1;
    console.error(`FAILED  ${error.stack ?? error}`);
  } finally {
    await close();
  }
  process.exit(failures === 0 ? 0 : 1);
}
