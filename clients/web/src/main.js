// Stillmap's page: wires the gateway's topics and services to the picture and the panel.
import { Connection } from "./connection.js";
import { MapTiles } from "./map_tiles.js";
import { Frames, matrixOfPose, nanoseconds } from "./poses.js";
import { View } from "./scene.js";
import { Server } from "./server.js";
import { ServerWatch } from "./server_watch.js";
import { showStatus } from "./status_panel.js";
import { colourModes, setGrid } from "./tile_material.js";
import { Timeline } from "./timeline.js";
import { Tools } from "./tools.js";

const element = (id) => document.getElementById(id);
const zoomStep = 1.25;
const turnStep = Math.PI / 12;
/** Colours by height reach from below the robot to above it [m]. */
const heightsBelow = 3;
const heightsAbove = 9;
const narrowWidth = 640;

// What keeps the page from starting is said where one looks for it.
const sayWhy = ({ message, reason }) => showConnection(message ?? reason?.message, false);
const startFaults = ["error", "unhandledrejection"];
for (const fault of startFaults) window.addEventListener(fault, sayWhy);

/** With the token, since the cookie may be that of another gateway of this host. */
async function factsOfGateway() {
  const response = await fetch(`gateway.json${location.search}`);
  if (!response.ok) throw new Error(`the gateway says: ${response.status} ${await response.text()}`);
  return response.json();
}

const token = new URLSearchParams(location.search).get("token");
const facts = await factsOfGateway();
const prefix = `/${facts.server}`;
const address = new URL(".", location.href);
address.protocol = location.protocol === "https:" ? "wss:" : "ws:";
if (token) address.search = new URLSearchParams({ token }).toString();

const view = new View(element("scene"));
const frames = new Frames();
const state = { frames, profiles: [], profile: "car", grid: undefined, robot: undefined, publishGoal };
const connection = new Connection(address.href, { callTimeoutMs: facts.timeout_ms, changed: showConnection, connected: begin });
const tiles = new MapTiles(connection, prefix, facts.format_version, () => view.draw(),
  (fault) => showConnection(fault ?? "connected", fault === undefined));
const server = new Server(connection, prefix, facts.format_version);
view.setMap(tiles);
const tools = new Tools({ view, tiles, server, state });
const timeline = new Timeline(view);
const watch = new ServerWatch(connection, () => server.profiles(), showConnection);

function showConnection(text, isGood) {
  element("connection").textContent = text;
  element("connection").classList.toggle("bad", !isGood);
}

const beginAgainMs = 3000;
let begun = 0;

/** The whole map and the robots; again after each time that the connection was lost. Only the last call goes on. */
async function begin() {
  const own = ++begun;
  const isLast = () => own === begun;
  try {
    await tiles.list();
    const profiles = await server.profiles();
    if (!isLast()) return;
    state.profiles = profiles;
    const choice = element("profile");
    choice.replaceChildren(...state.profiles.map((name) => new Option(name)));
    if (state.profiles.includes(state.profile)) choice.value = state.profile;
    else state.profile = choice.value;
    if (!state.grid) {
      const grid = await server.grid();
      // Unless a newer one has come by topic.
      if (isLast() && !state.grid) showGrid(grid);
    }
    if (isLast()) showConnection("connected", true);
  } catch (error) {
    if (!isLast()) return;
    showConnection(error.message, false);
    setTimeout(() => { if (isLast()) begin(); }, beginAgainMs);
  }
}

function showRobot(matrix) {
  state.robot = matrix;
  view.showRobot(matrix);
  const z = matrix.elements[14];
  tiles.material.uniforms.heights.value.set(z - heightsBelow, z + heightsAbove);
}

connection.listen("/tf_static", (message) => frames.addTransforms(message));
connection.listen(`${prefix}/odometry`, (message) => {
  frames.addOdometry(message);
  showRobot(frames.newest.matrix);
});
connection.listen(`${prefix}/path`, ({ poses }) => {
  const positions = new Float32Array(3 * poses.length);
  poses.forEach(({ pose }, i) => positions.set([pose.position.x, pose.position.y, pose.position.z], 3 * i));
  view.showLine(view.path, positions);
  // Of a map that was resumed: until the first scan, the robot is where the path ends.
  if (!frames.newest && poses.length > 0) showRobot(matrixOfPose(poses.at(-1).pose));
  timeline.update(poses);
});
connection.listen(`${prefix}/submaps`, (list) => view.showSubmaps(list));
connection.listen(`${prefix}/status`, (status) => {
  watch.heard();
  showStatus(status);
});
connection.listen(`${prefix}/traversability`, showGrid);

function showGrid(grid) {
  state.grid = grid;
  const { maxTextureSize } = view.renderer.capabilities;
  setGrid(tiles.material, grid, maxTextureSize);
  const { width, height } = grid.info;
  element("grid-note").textContent = Math.max(width, height) <= maxTextureSize ? ""
    : `No traversability in the picture: its grid has ${width} x ${height} cells, this browser draws up to ${maxTextureSize} a side.`;
  view.draw();
}

const scanTopic = `${prefix}/scan`;
function showScans() {
  connection.listen(scanTopic, (cloud) => {
    const matrix = frames.at(cloud.header.frame_id, nanoseconds(cloud.header.stamp));
    if (matrix) view.showScan(cloud, matrix);
  });
}
showScans();

function publishGoal({ x, y, z }) {
  const path = connection.definition("nav_msgs/msg/Path");
  if (!path) throw new Error("there is no connection to the gateway: the goal was not sent");
  const definition = path.replace(/^geometry_msgs\/PoseStamped\[\] poses$/m,
    "geometry_msgs/Pose pose");
  const now = Date.now();
  connection.publish("/goal_pose", "geometry_msgs/msg/PoseStamped", definition, {
    header: { stamp: { sec: Math.floor(now / 1000), nsec: (now % 1000) * 1e6 }, frame_id: frames.map },
    pose: { position: { x, y, z }, orientation: { x: 0, y: 0, z: 0, w: 1 } } });
}

function showCounts() {
  element("counts").textContent = `${tiles.voxels.toLocaleString("en")} voxels`;
}
view.onDrawn = showCounts;

function setFollowing(isFollowing) {
  view.isFollowing = isFollowing;
  element("follow").setAttribute("aria-pressed", String(isFollowing));
}
// Who moves the picture looks elsewhere.
view.onMoved = () => setFollowing(false);
element("follow").addEventListener("click", () => {
  setFollowing(!view.isFollowing);
  if (state.robot && view.isFollowing) view.showRobot(state.robot);
});
element("zoom-in").addEventListener("click", () => view.zoom(1 / zoomStep));
element("zoom-out").addEventListener("click", () => view.zoom(zoomStep));
element("turn-left").addEventListener("click", () => view.turn(turnStep));
element("turn-right").addEventListener("click", () => view.turn(-turnStep));
element("from-above").addEventListener("click", () => view.fromAbove());
element("colour").addEventListener("change", ({ target }) => {
  tiles.material.uniforms.mode.value = colourModes.indexOf(target.value);
  view.draw();
});
element("profile").addEventListener("change", ({ target }) => { state.profile = target.value; });
element("show-map").addEventListener("change", ({ target }) => { tiles.group.visible = target.checked; view.draw(); });
element("show-path").addEventListener("change", ({ target }) => { view.path.visible = target.checked; view.draw(); });
element("show-loops").addEventListener("change", ({ target }) => { view.graph.visible = target.checked; view.draw(); });
element("show-scan").addEventListener("change", ({ target }) => {
  view.scan.visible = target.checked;
  // What is not shown is not sent either: scans are most of the traffic.
  if (target.checked) showScans();
  else connection.unlisten(scanTopic);
  view.draw();
});
function showPanel(isShown) {
  element("panel").hidden = !isShown;
  element("panel-toggle").setAttribute("aria-expanded", String(isShown));
}
element("panel-toggle").addEventListener("click", () => showPanel(element("panel").hidden));
showPanel(window.innerWidth > narrowWidth);

for (const fault of startFaults) window.removeEventListener(fault, sayWhy);

// For the tests and for who is curious.
window.stillmap = { view, tiles, server, state, tools, timeline, connection };
