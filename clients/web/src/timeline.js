// The drive so far: a slider over the published path, with the robot where it was.
import { matrixOfPose, nanoseconds } from "./poses.js";

const element = (id) => document.getElementById(id);

export class Timeline {
  constructor(view) {
    this.view = view;
    this.poses = [];
    this.isLive = true;
    element("time").addEventListener("input", () => this.#choose(Number(element("time").value)));
    element("live").addEventListener("click", () => this.#live());
  }

  /** The poses of a nav_msgs/Path. */
  update(poses) {
    this.poses = poses;
    const slider = element("time");
    slider.max = String(Math.max(poses.length - 1, 0));
    slider.value = this.isLive ? slider.max : String(this.#indexOfChosen());
    const index = Number(slider.value);
    // A long path comes thinned out, and after a correction elsewhere.
    if (!this.isLive && poses[index]) this.view.showPast(matrixOfPose(poses[index].pose));
    this.#tell(index);
  }

  /** The last pose that is not after the chosen one. */
  #indexOfChosen() {
    const after = this.poses.findIndex(({ header }) => nanoseconds(header.stamp) > this.chosen);
    return after < 0 ? Math.max(this.poses.length - 1, 0) : Math.max(after - 1, 0);
  }

  #choose(index) {
    if (!this.poses[index]) return;
    this.isLive = false;
    this.chosen = nanoseconds(this.poses[index].header.stamp);
    element("live").setAttribute("aria-pressed", "false");
    this.view.isShowingPast = true;
    this.view.showPast(matrixOfPose(this.poses[index].pose));
    this.#tell(index);
  }

  #live() {
    this.isLive = true;
    element("live").setAttribute("aria-pressed", "true");
    this.view.isShowingPast = false;
    this.view.showPast(undefined);
    this.update(this.poses);
  }

  #tell(index) {
    if (!this.poses[index]) return;
    const first = nanoseconds(this.poses[0].header.stamp);
    const seconds = Number(nanoseconds(this.poses[index].header.stamp) - first) / 1e9;
    element("time-text").textContent = `${seconds.toFixed(1)} s`;
  }
}
