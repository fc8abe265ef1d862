// The page in headless Chromium, against a live server with a map and a replay. STILLMAP_PICTURES keeps screenshots.
import assert from "node:assert/strict";
import { mkdirSync } from "node:fs";
import { join } from "node:path";
import { after, before, describe, it } from "node:test";
import { chromium, countTransfers } from "./browser.mjs";
import { Stack, eventually } from "./stack.mjs";

const pictures = process.env.STILLMAP_PICTURES;

/** Of the drive: more way than one submap has. */
const scans = 45;

describe("page", () => {
  const stack = new Stack();
  let browser;
  let page;
  let url;
  const problems = [];

  const evaluate = (work, ...parameters) => page.evaluate(work, ...parameters);
  const whole = () => eventually("the whole map", () => evaluate(() => {
    const { tiles } = window.stillmap ?? {};
    return tiles && tiles.tiles.size > 0 && tiles.pending === 0 && tiles.voxels;
  }));
  const answer = () => evaluate(() => document.getElementById("answer").innerText);
  const answered = (pattern) => eventually(`an answer like ${pattern}`, async () => pattern.test(await answer()) && answer());
  const picture = async (name) => {
    if (pictures) await page.screenshot({ path: join(pictures, `${name}.png`) });
  };

  before(async () => {
    if (pictures) mkdirSync(pictures, { recursive: true });
    stack.startServer("--delivery", "every");
    const port = await stack.startGateway();
    url = `http://127.0.0.1:${port}/`;
    await stack.replay(stack.simulate(scans), "--lossless").ended;
    browser = await chromium(stack.folder);
    page = await browser.newPage();
    page.on("pageerror", (error) => problems.push(error.message));
    page.on("console", (message) => { if (message.type() === "error") problems.push(message.text()); });
    await page.setViewport({ width: 1100, height: 700 });
    await page.goto(url);
  });
  after(async () => {
    await browser?.close();
    await stack.end();
  });

  it("shows every voxel that a query counts", async () => {
    const voxels = await whole();
    assert.equal(voxels, stack.ask("status").voxels);
    const inBox = stack.ask("query", "--box", "-500", "-500", "-100", "500", "500", "100");
    assert.equal(voxels, inBox.voxels);
    await picture("map");
  });

  it("paints the map", async () => {
    await evaluate(() => document.getElementById("from-above").click());
    const painted = await evaluate(() => new Promise((resolve) => {
      const { view } = window.stillmap;
      view.onDrawn = () => {
        const gl = view.renderer.getContext();
        const pixels = new Uint8Array(4 * gl.drawingBufferWidth * gl.drawingBufferHeight);
        gl.readPixels(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
        let n = 0;
        for (let i = 0; i < pixels.length; i += 4) if (pixels[i] + pixels[i + 1] + pixels[i + 2] > 100) ++n;
        view.onDrawn = undefined;
        resolve(n / (pixels.length / 4));
      };
      view.draw();
    }));
    assert.ok(painted > 0.02, `${(100 * painted).toFixed(1)} % of the picture`);
    for (const colour of ["height", "traversability"]) {
      await page.select("#colour", colour);
      await picture(colour);
    }
    await page.select("#colour", "class");
  });

  it("knows robot, path, robots and health", async () => {
    await eventually("the robots", () => evaluate(() => window.stillmap.state.profiles.length === 2));
    await eventually("the path", () => evaluate((expected) => window.stillmap.timeline.poses.length === expected, scans));
    await eventually("the health", () => evaluate(() => /health\s*good/.test(document.getElementById("status").innerText)));
  });

  it("shows the submaps that the server has", async () => {
    const { submaps } = await eventually("a submap", () => {
      const list = stack.ask("loops");
      return list.submaps.length > 0 && list;
    });
    const shown = () => evaluate(() => [...window.stillmap.view.graph.places.geometry.getAttribute("position")?.array ?? []]);
    const [x, y, z] = await eventually("all of them", async () => (await shown()).length === 3 * submaps.length && shown());
    submaps[0].position_m.forEach((value, axis) => assert.ok(Math.abs(value - [x, y, z][axis]) < 0.01, `${value}`));
    await picture("submaps");
    await page.click("#show-loops");
    assert.ok(!await evaluate(() => window.stillmap.view.graph.visible));
    await page.click("#show-loops");
  });

  /** Clicks where the first voxel of a class is, or any ground. */
  const clickVoxel = async (labels) => {
    const at = await evaluate((wanted) => {
      const { view, tiles } = window.stillmap;
      view.fromAbove();
      for (const points of tiles.group.children) {
        const values = points.geometry.getAttribute("position").data.array;
        for (let i = 0; i < values.length; i += 4) {
          if (!wanted.includes(values[i + 3])) continue;
          const { x, y, z } = points.position;
          const scale = points.scale.x;
          const p = view.controls.target.clone().set(x + scale * values[i], y + scale * values[i + 1], z + scale * values[i + 2]);
          view.lookAt(p);
          view.camera.updateMatrixWorld();
          return [p.x, p.y];
        }
      }
      return undefined;
    }, labels);
    assert.ok(at, "a voxel of these classes");
    await page.mouse.click(550, 350);
    return at;
  };

  it("says what a voxel is, and for whom the place is free", async () => {
    await evaluate(() => document.querySelector('[data-tool="inspect"]').click());
    await clickVoxel([13, 9, 11, 12]);
    const text = await answered(/free for delivery_robot/);
    assert.match(text, /% of the evidence, \d+ points/);
    assert.match(text, /removed within 0.75 m/);
    assert.match(text, /free for car/);
    await picture("inspect");
  });

  it("counts a polygon as the command line does", async () => {
    await evaluate(() => document.querySelector('[data-tool="polygon"]').click());
    for (const [x, y] of [[300, 200], [700, 200], [700, 550], [300, 550]]) await page.mouse.click(x, y);
    const corners = await evaluate(() => window.stillmap.tools.corners.map(([x, y]) => [x, y]));
    assert.equal(corners.length, 4);
    await evaluate(() => document.getElementById("finish").click());
    const [, total] = (await answered(/^\d+ voxels/)).match(/^(\d+) voxels/);
    const same = stack.ask("query", "--polygon", ...corners.flat().map(String), "--min-z", "-1000", "--max-z", "1000");
    assert.equal(Number(total), same.voxels);
    await picture("polygon");
  });

  it("plans to a goal and has the server check the path", async () => {
    await evaluate(() => document.querySelector('[data-tool="goal"]').click());
    await evaluate(() => {
      const { view, state } = window.stillmap;
      const robot = view.controls.target.clone().setFromMatrixPosition(state.robot);
      view.lookAt(robot);
      view.fromAbove();
      view.camera.updateMatrixWorld();
    });
    await page.mouse.click(560, 360);
    await answered(/path of [\d.]+ m|goal is|no free way|outside/);
    await picture("goal");
  });

  it("goes back in time", async () => {
    await evaluate(() => {
      const slider = document.getElementById("time");
      slider.value = "0";
      slider.dispatchEvent(new Event("input"));
    });
    assert.ok(await evaluate(() => window.stillmap.view.past.visible));
    await page.click("#live");
    assert.ok(!await evaluate(() => window.stillmap.view.past.visible));
  });

  it("works at a phone's width without a wheel", async () => {
    await page.setViewport({ width: 390, height: 844, hasTouch: true, isMobile: true });
    await page.reload();
    await whole();
    const wide = await evaluate(() => document.documentElement.scrollWidth);
    assert.ok(wide <= 390, `${wide} px wide`);
    const distance = () => evaluate(() => window.stillmap.view.camera.position.distanceTo(window.stillmap.view.controls.target));
    const far = await distance();
    await page.tap("#zoom-in");
    assert.ok(await distance() < far);
    await page.tap("#panel-toggle");
    assert.ok(await evaluate(() => !document.getElementById("panel").hidden));
    await picture("phone");
    await page.setViewport({ width: 1100, height: 700 });
  });

  it("loads no tile twice", async () => {
    const counts = countTransfers(page);
    await page.goto("about:blank");
    await page.goto(url);
    await whole();
    assert.equal(counts.tiles, 0, "tiles over the network");
    assert.ok(counts.bytes < 20_000, `${counts.bytes} bytes`);
  });

  it("follows the map while it grows", async () => {
    const frames = await evaluate(() => window.stillmap.view.frames);
    await stack.replay(stack.simulate(scans), "--lossless").ended;
    await eventually("new frames", () => evaluate((before) => window.stillmap.view.frames > before, frames));
    await eventually("all voxels", async () => await whole() === stack.ask("status").voxels);
  });

  it("has no problems of its own", () => { assert.deepEqual(problems, []); });

  it("drops the map of a server that began another one, without a tile", async () => {
    await whole();
    stack.server.kill("SIGKILL");
    await stack.server.ended;
    stack.startServer("--delivery", "every");
    await eventually("an empty map", () => evaluate(() => window.stillmap.tiles.tiles.size === 0));
  });
});
