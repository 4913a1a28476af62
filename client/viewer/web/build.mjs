// Builds the page: proto files -> TypeScript -> one bundle in dist/.
//
//   SCINDO_PROTO   folder that holds scindo/v1/*.proto (default: ../../../proto)
//
// Everything lands in gen/ and dist/ beside this file; cargo runs it on a copy in OUT_DIR.
import { execFileSync } from "node:child_process";
import { cpSync, mkdirSync, rmSync } from "node:fs";
import path from "node:path";
import { fileURLToPath } from "node:url";

const here = path.dirname(fileURLToPath(import.meta.url));
const proto = path.resolve(process.env.SCINDO_PROTO ?? path.join(here, "../../../proto"));
const gen = path.join(here, "gen");
const dist = path.join(here, "dist");

function generate() {
  const template = {
    version: "v2",
    plugins: [
      {
        local: ["node", path.join(here, "node_modules/@bufbuild/protoc-gen-es/bin/protoc-gen-es")],
        out: gen,
        opt: ["target=ts"],
      },
    ],
  };
  rmSync(gen, { recursive: true, force: true });
  execFileSync(
    process.execPath,
    [path.join(here, "node_modules/@bufbuild/buf/bin/buf"), "generate", proto, "--template", JSON.stringify(template)],
    { cwd: here, stdio: "inherit", env: { ...process.env, BUF_CACHE_DIR: path.join(here, ".buf-cache") } },
  );
}

async function bundle() {
  const { build } = await import("esbuild");
  rmSync(dist, { recursive: true, force: true });
  mkdirSync(dist, { recursive: true });
  await build({
    entryPoints: { viewer: path.join(here, "src/main.ts") },
    outdir: dist,
    // What few people need, such as the headset, is loaded when it is asked for.
    splitting: true,
    chunkNames: "[name]-[hash]",
    bundle: true,
    minify: true,
    format: "esm",
    target: "es2022",
    legalComments: "linked",
    logLevel: "info",
  });
  for (const file of ["index.html", "style.css", "icon.svg"]) {
    cpSync(path.join(here, "static", file), path.join(dist, file));
  }
}

generate();
if (!process.argv.includes("--generate")) await bundle();
