// What a click means: a question about a place, a corner of a region, a goal.
import { Plane, Vector3 } from "three";
import { className } from "./classes.js";
import { planOnGrid } from "./grid_planner.js";
import { corridorRegion, polygonRegion } from "./server.js";

const help = {
  inspect: "Click a voxel: what it is, what was removed there, whether a robot can be there.",
  polygon: "Click the corners of a region on the map, then Ask.",
  corridor: "Click a path, then Ask: all within half the width of it.",
  goal: "Click where to go: a path over the server's grid, checked by the server; where it is free, the goal is published as /goal_pose.",
};
const longestCheck = 400;

const element = (id) => document.getElementById(id);

/** Every n-th position, the last one too. */
function thinned(path, most) {
  const step = Math.ceil(path.length / most);
  return path.filter((_, i) => i % step === 0 || i === path.length - 1);
}

export class Tools {
  constructor({ view, tiles, server, state }) {
    Object.assign(this, { view, tiles, server, state });
    this.tool = "inspect";
    this.corners = [];
    for (const button of document.querySelectorAll("[data-tool]")) {
      button.addEventListener("click", () => this.choose(button.dataset.tool));
    }
    element("finish").addEventListener("click", () => this.#ask());
    element("clear").addEventListener("click", () => this.clear());
    view.onClick((ray) => this.#clicked(ray));
    this.choose("inspect");
  }

  choose(tool) {
    this.tool = tool;
    this.clear();
    for (const button of document.querySelectorAll("[data-tool]")) {
      button.setAttribute("aria-pressed", String(button.dataset.tool === tool));
    }
    element("tool-help").textContent = help[tool];
    const isRegion = tool === "polygon" || tool === "corridor";
    element("finish").hidden = !isRegion;
    element("width-row").hidden = tool !== "corridor";
  }

  clear() {
    // What is asked for now shows nothing any more.
    this.asked = (this.asked ?? 0) + 1;
    this.corners = [];
    this.view.picked.visible = false;
    this.view.showLine(this.view.outline, new Float32Array());
    this.view.showLine(this.view.plan, new Float32Array());
    this.#show([]);
  }

  /** The voxel under the ray, else where it meets the height of the robot. */
  #placeOn(ray) {
    const voxel = this.tiles.pick(ray, this.view.tolerance);
    if (voxel) return { ...voxel, isVoxel: true };
    const position = ray.intersectPlane(new Plane(new Vector3(0, 0, 1), -this.view.controls.target.z), new Vector3());
    return position ? { position } : undefined;
  }

  #clicked(ray) {
    const place = this.#placeOn(ray);
    if (!place) return;
    if (this.tool === "inspect") this.#run(() => this.#inspect(place));
    else if (this.tool === "goal") this.#run((isWanted) => this.#plan(place.position, isWanted));
    else this.#addCorner(place.position);
  }

  #addCorner({ x, y, z }) {
    this.corners.push([x, y, z + 0.3]);
    this.view.showLine(this.view.outline, new Float32Array(this.corners.flat()));
    this.#show([`${this.corners.length} corners`]);
  }

  /** Shows what `work(isWanted)` answers, unless something else was asked for meanwhile. */
  async #run(work) {
    const own = ++this.asked;
    const isWanted = () => own === this.asked;
    this.#show(["asking ..."]);
    let lines;
    try {
      lines = await work(isWanted);
    } catch (error) {
      lines = [["bad", error.message]];
    }
    if (isWanted()) this.#show(lines);
  }

  async #inspect({ position, label, isVoxel }) {
    this.view.picked.position.copy(position);
    this.view.picked.visible = true;
    this.view.draw();
    const at = `(${position.x.toFixed(2)}, ${position.y.toFixed(2)}, ${position.z.toFixed(2)})`;
    const [evidence, removed, ...free] = await Promise.all([
      isVoxel ? this.server.evidenceAt(position, 0.3) : undefined,
      this.server.removedAt(position),
      ...this.state.profiles.map((profile) => this.server.freeAt(profile, position)),
    ]);
    const lines = [`${isVoxel ? className(label) : "no voxel"} at ${at}`];
    if (evidence) {
      lines.push(`${className(evidence.label)} with ${(100 * evidence.confidence).toFixed(0)} % of the evidence, ` +
        `${evidence.points} points`);
    }
    for (const [reason, name, n] of removed) lines.push(`removed within 0.75 m: ${n} of ${name}, ${reason}`);
    if (removed.length === 0) lines.push("nothing was removed within 0.75 m");
    free.forEach(({ isFree, why }, i) => {
      const robot = this.state.profiles[i];
      lines.push(isFree ? ["good", `free for ${robot}`] : ["bad", `not free for ${robot}: ${why || "blocked"}`]);
    });
    return lines;
  }

  #ask() {
    const least = this.tool === "polygon" ? 3 : 2;
    if (this.corners.length < least) return this.#show([["bad", `at least ${least} corners are needed`]]);
    const width = Number(element("corridor-width").value);
    const region = this.tool === "polygon" ? polygonRegion(this.corners) : corridorRegion(this.corners, width);
    return this.#run(async (isWanted) => {
      const { total, byClass } = await this.server.voxelsIn(region, isWanted);
      return [`${total} voxels`, ...byClass.map(([name, n]) => `${name}: ${n}`)];
    });
  }

  /** The goal is published once its path is free. */
  async #plan(goal, isWanted) {
    const { robot } = this.state;
    if (!robot) throw new Error("the robot's pose is not known yet");
    if (!this.state.grid) throw new Error("the server publishes no grid (traversability.grid_profile)");
    const from = new Vector3().setFromMatrixPosition(robot);
    const { path, fault } = planOnGrid(this.state.grid, [from.x, from.y], [goal.x, goal.y]);
    if (fault) throw new Error(fault);
    this.view.showLine(this.view.plan, new Float32Array(path.flatMap(([x, y]) => [x, y, goal.z + 0.5])));
    let length = 0;
    for (let i = 1; i < path.length; ++i) length += Math.hypot(path[i][0] - path[i - 1][0], path[i][1] - path[i - 1][1]);
    const lines = [`path of ${length.toFixed(1)} m`];
    const check = await this.server.checkPath(this.state.profile, thinned(path, longestCheck));
    if (!check.isFree) {
      lines.push(["bad", `the server: ${this.state.profile} would touch something at ` +
        `(${check.at.map((v) => v.toFixed(1)).join(", ")}): ${check.why}; the goal was not published`]);
      return lines;
    }
    lines.push(["good", `the server: free for ${this.state.profile}, clearance ${check.clearance.toFixed(1)} m`]);
    if (!isWanted()) return lines;
    this.state.publishGoal(goal);
    lines.push("sent to /goal_pose");
    return lines;
  }

  #show(lines) {
    element("answer").replaceChildren(...lines.map((line) => {
      const [kind, text] = Array.isArray(line) ? line : ["", line];
      const row = document.createElement("div");
      row.className = kind;
      row.textContent = text;
      return row;
    }));
  }
}
