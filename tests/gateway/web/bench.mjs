// Figures of gateway and page, as tables: `make bench-web`.
//
//     node bench.mjs gateway [SECONDS]    a scan of 2 MB at 10 Hz to ten clients, alone and beside one that is stopped
//     node bench.mjs page [MAP]           a map file (without one: eleven copies of a simulated avenue, 5 million voxels)
//                                         in headless Chromium: first picture, frames a second, second visit
import { execFileSync, fork, spawn } from "node:child_process";
import { copyFileSync, existsSync, mkdirSync, readFileSync } from "node:fs";
import { join } from "node:path";
import { Client, Stack, eventually, sleep } from "./stack.mjs";
import { chromium, countTransfers } from "./browser.mjs";

const clients = 10;
const pointsOfScan = 131072;
const rateHz = 10;
const ticksPerSecond = Number(execFileSync("getconf", ["CLK_TCK"]));

/** Processor time of a process so far [s]. */
function processorTime(pid) {
  const fields = readFileSync(`/proc/${pid}/stat`, "latin1").split(") ").at(-1).split(" ");
  return (Number(fields[11]) + Number(fields[12])) / ticksPerSecond;
}

const residentMiB = (pid) => Number(readFileSync(`/proc/${pid}/status`, "latin1").match(/VmRSS:\s+(\d+)/)[1]) / 1024;

function quantile(values, share) {
  const sorted = [...values].sort((a, b) => a - b);
  return sorted[Math.min(sorted.length - 1, Math.floor(share * sorted.length))];
}

/** A process that listens to scans, and says how old they were [ms] when it is told to end. */
async function listenToScans(port) {
  const client = new Client(port);
  await client.ready();
  const ages = [];
  client.listen("/points", (data) => {
    // Behind the encapsulation, a scan begins with its stamp.
    const stampMs = data.getUint32(4, true) * 1000 + data.getUint32(8, true) / 1e6;
    ages.push(Date.now() - stampMs);
  }, { raw: true });
  process.on("message", () => {
    process.send(ages);
    process.exit();
  });
  process.send("ready");
}

/** Ages of the scans of each client, and what the gateway took meanwhile. */
async function measureGateway(seconds, isOneStopped) {
  const stack = new Stack();
  const port = await stack.startGateway("--no-page");
  const listeners = [];
  for (let i = 0; i < clients + (isOneStopped ? 1 : 0); ++i) {
    const child = fork(new URL(import.meta.url), ["listen", String(port)]);
    await new Promise((resolve) => child.once("message", resolve));
    listeners.push(child);
  }
  const publisher = spawn(join(process.env.BUILD, "tests/idl/plain_publisher"),
    [stack.domain, String(pointsOfScan), String(rateHz), String(rateHz * (seconds + 2)), "5", "reliable"], { stdio: "ignore" });
  await sleep(2000);
  if (isOneStopped) listeners[clients].kill("SIGSTOP");
  const begin = processorTime(stack.gateway.pid);
  await sleep(seconds * 1000);
  const cores = (processorTime(stack.gateway.pid) - begin) / seconds;
  const memory = residentMiB(stack.gateway.pid);
  const ages = await Promise.all(listeners.slice(0, clients).map((child) => new Promise((resolve) => {
    child.once("message", resolve);
    child.send("end");
  })));
  listeners.at(-1).kill("SIGKILL");
  publisher.kill("SIGTERM");
  await stack.end();
  const worst = (share) => Math.max(...ages.map((of) => quantile(of, share)));
  return { received: Math.min(...ages.map((of) => of.length)), sent: rateHz * (seconds + 2), p50: worst(0.5), p99: worst(0.99), cores, memory };
}

async function benchGateway(seconds) {
  console.log(`| ${clients} clients, scans of 2 MB at ${rateHz} Hz | received by each | p50 | p99 of the worst | gateway | resident |`);
  console.log("|---|---|---|---|---|---|");
  // In turns: these machines change while one looks.
  for (const isOneStopped of [false, true, false, true, false, true]) {
    const { received, sent, p50, p99, cores, memory } = await measureGateway(seconds, isOneStopped);
    console.log(`| ${isOneStopped ? "and one that is stopped" : "alone"} | ${received} of ${sent} | ${p50.toFixed(1)} ms | ${p99.toFixed(1)} ms ` +
      `| ${cores.toFixed(2)} cores | ${memory.toFixed(0)} MiB |`);
  }
}

/** Turns the picture for some seconds; the frames of it. */
const turn = (page, seconds) => page.evaluate((ms) => new Promise((resolve) => {
  const { view, tiles } = window.stillmap;
  const times = [];
  const begin = performance.now();
  const step = (now) => {
    times.push(now);
    if (now - begin > ms) { resolve({ times, drawn: tiles.drawn, budget: view.budget }); return; }
    view.turn(0.02);
    requestAnimationFrame(step);
  };
  requestAnimationFrame(step);
}), seconds * 1000);

async function openPage(browser, url) {
  const page = await browser.newPage();
  await page.setViewport({ width: 1280, height: 800 });
  // Before anything of the page runs: when the first voxels were drawn, and when all were there.
  await page.evaluateOnNewDocument(() => {
    const look = () => {
      const { view, tiles } = window.stillmap ?? {};
      if (tiles && tiles.drawn > 0 && view.frames > 0) window.firstPictureMs ??= performance.now();
      if (tiles && tiles.tiles.size > 0 && tiles.pending === 0) window.wholeMapMs ??= performance.now();
      if (window.wholeMapMs === undefined) setTimeout(look, 20);
    };
    look();
  });
  const transfers = countTransfers(page);
  await page.goto(url);
  await eventually("the whole map", () => page.evaluate(() => window.wholeMapMs !== undefined));
  const times = await page.evaluate(() => ({ first: window.firstPictureMs, whole: window.wholeMapMs, voxels: window.stillmap.tiles.voxels }));
  return { page, transfers, ...times };
}

/** A map file of 5 million voxels, made where it is not there yet. */
function largeMap() {
  const folder = join(process.env.BUILD, "bench_web");
  const map = join(folder, "large.stillmap");
  if (existsSync(map)) return map;
  mkdirSync(folder, { recursive: true });
  const stillmap = (...words) => execFileSync(join(process.env.BUILD, "bin/stillmap"), words, { cwd: folder, stdio: "ignore" });
  if (!existsSync(join(folder, "avenue"))) stillmap("simulate", "avenue", "--preset", "crowd", "--seed", "3", "--scans", "220");
  stillmap("map", "avenue", "--out", "mapped", "--loops", "off", "--force");
  execFileSync(join(process.env.BUILD, "tests/scale/copied_map"), [join(folder, "mapped/map.stillmap"), map, "11"]);
  return map;
}

async function benchPage(map) {
  const seconds = 5;
  const stack = new Stack();
  // A server writes to its file.
  copyFileSync(map, join(stack.folder, "map.stillmap"));
  stack.startServer("--map-file", join(stack.folder, "map.stillmap"));
  await eventually("the map", () => stack.ask("status").voxels > 0);
  const port = await stack.startGateway();
  const browser = await chromium(stack.folder);
  console.log("| visit | voxels | first picture | whole map | bytes over the network |");
  console.log("|---|---|---|---|---|");
  let last;
  for (const visit of ["first", "second"]) {
    await last?.page.close();
    last = await openPage(browser, `http://127.0.0.1:${port}/`);
    console.log(`| ${visit} | ${last.voxels} | ${(last.first / 1000).toFixed(2)} s | ${(last.whole / 1000).toFixed(2)} s | ${last.transfers.bytes} |`);
  }
  console.log("\n| turning | frames a second | slowest of 100 | voxels drawn |");
  console.log("|---|---|---|---|");
  for (const what of ["near the robot", "the whole map in sight"]) {
    if (what !== "near the robot") {
      await last.page.evaluate(() => {
        const { view, tiles } = window.stillmap;
        const middle = view.controls.target.clone().set(0, 0, 0);
        for (const { centre } of tiles.tiles.values()) middle.addScaledVector(centre, 1 / tiles.tiles.size);
        let far = 0;
        for (const { centre } of tiles.tiles.values()) far = Math.max(far, centre.distanceTo(middle));
        view.lookAt(middle);
        view.zoom(1.8 * far / view.camera.position.distanceTo(view.controls.target));
      });
    }
    // The page chooses how much it draws while it is drawn.
    await turn(last.page, seconds);
    const { times, drawn } = await turn(last.page, seconds);
    const gaps = times.slice(1).map((time, i) => time - times[i]);
    console.log(`| ${what} | ${((times.length - 1) / (times.at(-1) - times[0]) * 1000).toFixed(1)} | ${quantile(gaps, 0.99).toFixed(0)} ms | ${drawn} |`);
    if (process.env.STILLMAP_PICTURES) {
      await last.page.screenshot({ path: join(process.env.STILLMAP_PICTURES, `${what.replaceAll(" ", "_")}.png`) });
    }
  }
  await browser.close();
  await stack.end();
}

const [what, parameter] = process.argv.slice(2);
if (what === "listen") await listenToScans(Number(parameter));
else if (what === "gateway") await benchGateway(Number(parameter ?? 20));
else if (what === "page") await benchPage(parameter ?? largeMap());
else {
  console.error("usage: bench.mjs gateway [SECONDS] | page [MAP]");
  process.exit(2);
}
