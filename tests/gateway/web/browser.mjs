// Headless Chromium, drawing by software.
import { patienceMs, require } from "./stack.mjs";

const puppeteer = require("puppeteer-core");

const flags = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-quic", "--no-first-run",
  "--disable-background-networking", "--disable-component-update", "--disable-sync"];

/** With its profile in this folder. */
export const chromium = (folder) => puppeteer.launch({ executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium", headless: true,
  protocolTimeout: patienceMs, args: [...flags, `--user-data-dir=${folder}/browser`] });

/** Of a page's answers, what came over the network and not from the browser's cache. */
export function countTransfers(page) {
  const counts = { bytes: 0, tiles: 0 };
  page.on("response", async (response) => {
    if (response.fromCache()) return;
    counts.bytes += Number(response.headers()["content-length"] ?? 0);
    if (response.url().includes("/tiles/")) ++counts.tiles;
  });
  return counts;
}
