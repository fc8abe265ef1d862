// The picture: map, robot, path, scan and what is drawn on them; rendered when something changed.
import { AxesHelper, BufferAttribute, BufferGeometry, Color, ConeGeometry, Frustum, Group, Line, LineLoop, LineBasicMaterial,
  LineSegments, Matrix4, Mesh, MeshBasicMaterial, MOUSE, PerspectiveCamera, Points, PointsMaterial, Raycaster, Scene, SphereGeometry, Vector2,
  Vector3, WebGLRenderer } from "three";
import { MapControls } from "three/examples/jsm/controls/MapControls.js";
import { classes } from "./classes.js";

const minBudget = 50_000;
const maxBudget = 5_000_000;
/** Of a picture in which nothing has moved for a moment: it may take long. */
const stillBudget = 600_000;
const stillAfterMs = 400;
/** Frames that take longer get fewer voxels, shorter ones more. */
const slowFrameMs = 80;
const fastFrameMs = 45;
/** A frame that is asked for so soon after the last one follows it at once. */
const framesInRowMs = 17;
const clickPixels = 6;

function lineOf(colour) {
  const line = new Line(new BufferGeometry(), new LineBasicMaterial({ color: colour, depthTest: false }));
  line.frustumCulled = false;
  line.renderOrder = 1;
  return line;
}

function setPositions(object, positions) {
  object.geometry.dispose();
  object.geometry = new BufferGeometry();
  object.geometry.setAttribute("position", new BufferAttribute(positions, 3));
}

/** Submaps, and a line for each loop that joins two. */
function submapGraph() {
  const graph = new Group();
  const places = new Points(new BufferGeometry(), new PointsMaterial({ size: 7, sizeAttenuation: false, color: 0xffd54f, depthTest: false }));
  const loops = new LineSegments(new BufferGeometry(), new LineBasicMaterial({ color: 0x00e676, depthTest: false }));
  for (const part of [places, loops]) {
    part.frustumCulled = false;
    part.renderOrder = 1;
  }
  graph.add(places, loops);
  return Object.assign(graph, { places, loops });
}

function robotMarker(colour) {
  const marker = new Group();
  const cone = new Mesh(new ConeGeometry(0.7, 2.4, 12), new MeshBasicMaterial({ color: colour, depthTest: false }));
  // Its tip is where x leads.
  cone.rotation.z = -Math.PI / 2;
  cone.renderOrder = 2;
  marker.add(cone, new AxesHelper(2));
  marker.matrixAutoUpdate = false;
  marker.visible = false;
  return marker;
}

export class View {
  constructor(canvas) {
    this.canvas = canvas;
    this.renderer = new WebGLRenderer({ canvas, powerPreference: "high-performance" });
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 1.5));
    this.scene = new Scene();
    this.scene.background = new Color(0x0b0f14);
    this.camera = new PerspectiveCamera(55, 1, 0.5, 20000);
    this.camera.up.set(0, 0, 1);
    this.camera.position.set(-35, -35, 45);
    this.controls = new MapControls(this.camera, canvas);
    this.controls.enableDamping = false;
    this.controls.maxPolarAngle = Math.PI / 2 - 0.02;
    this.controls.mouseButtons = { LEFT: MOUSE.PAN, MIDDLE: MOUSE.DOLLY, RIGHT: MOUSE.ROTATE };
    this.controls.addEventListener("start", () => { this.isHeld = true; });
    this.controls.addEventListener("end", () => { this.isHeld = false; });
    this.controls.addEventListener("change", () => {
      // Not of a click that moves nothing.
      if (this.isHeld) this.onMoved?.();
      this.draw();
    });
    this.robot = robotMarker(0xffffff);
    this.past = robotMarker(0x2f81f7);
    this.path = lineOf(0xffffff);
    this.plan = lineOf(0x2f81f7);
    this.outline = new LineLoop(new BufferGeometry(), new LineBasicMaterial({ color: 0xffa726, depthTest: false }));
    this.outline.frustumCulled = false;
    this.outline.renderOrder = 1;
    this.picked = new Mesh(new SphereGeometry(0.25, 12, 8), new MeshBasicMaterial({ color: 0xffffff, wireframe: true }));
    this.picked.visible = false;
    this.scan = new Points(new BufferGeometry(), new PointsMaterial({ size: 2, sizeAttenuation: false, vertexColors: true }));
    this.scan.matrixAutoUpdate = false;
    this.scan.frustumCulled = false;
    this.graph = submapGraph();
    this.scene.add(this.robot, this.past, this.graph, this.path, this.plan, this.outline, this.picked, this.scan);
    this.budget = 1_500_000;
    this.frames = 0;
    this.isFollowing = true;
    new ResizeObserver(() => this.#resize()).observe(canvas);
    this.#resize();
  }

  setMap(tiles) {
    this.tiles = tiles;
    this.scene.add(tiles.group);
  }

  draw() { this.#request(this.budget); }

  #request(budget) {
    if (this.isWaiting) return;
    this.isWaiting = true;
    this.requestedAt = performance.now();
    clearTimeout(this.stillTimer);
    requestAnimationFrame((now) => this.#frame(now, budget));
  }

  get pixelsPerMetre() {
    return this.renderer.getDrawingBufferSize(new Vector2()).y / (2 * Math.tan(this.camera.fov * Math.PI / 360));
  }

  #frame(now, budget) {
    this.isWaiting = false;
    this.camera.updateMatrixWorld();
    if (this.tiles) {
      const frustum = new Frustum().setFromProjectionMatrix(
        new Matrix4().multiplyMatrices(this.camera.projectionMatrix, this.camera.matrixWorldInverse));
      this.tiles.material.uniforms.pixelsPerMetre.value = this.pixelsPerMetre;
      this.tiles.chooseDetail(this.camera, frustum, this.pixelsPerMetre, budget);
    }
    this.renderer.render(this.scene, this.camera);
    ++this.frames;
    // Only frames in a row tell how long one takes: else it is the time until something changed.
    if (this.requestedAt - this.frameEnd < framesInRowMs) this.#adapt(now - this.lastFrame);
    this.lastFrame = now;
    this.frameEnd = performance.now();
    if (budget < stillBudget) this.stillTimer = setTimeout(() => this.#request(stillBudget), stillAfterMs);
    this.onDrawn?.();
  }

  #adapt(frameMs) {
    if (frameMs > slowFrameMs) this.budget = Math.max(minBudget, this.budget * 0.85);
    else if (frameMs < fastFrameMs) this.budget = Math.min(maxBudget, this.budget * 1.05);
  }

  #resize() {
    const { clientWidth, clientHeight } = this.canvas;
    if (!clientWidth || !clientHeight) return;
    this.renderer.setSize(clientWidth, clientHeight, false);
    this.camera.aspect = clientWidth / clientHeight;
    this.camera.updateProjectionMatrix();
    this.draw();
  }

  /** Moves the middle of the picture, and the eye with it. */
  lookAt(position) {
    const by = position.clone().sub(this.controls.target);
    this.controls.target.add(by);
    this.camera.position.add(by);
    this.controls.update();
    this.draw();
  }

  showRobot(matrix) {
    this.robot.matrix.copy(matrix);
    this.robot.visible = true;
    const position = new Vector3().setFromMatrixPosition(matrix);
    const isFollowing = this.isFollowing && !this.isShowingPast;
    if (this.tiles) this.tiles.near.copy(isFollowing ? position : this.controls.target);
    if (isFollowing) this.lookAt(position);
    this.draw();
  }

  /** Where the robot was; hides it without a matrix. */
  showPast(matrix) {
    this.past.visible = matrix !== undefined;
    if (matrix) {
      this.past.matrix.copy(matrix);
      if (this.isFollowing) this.lookAt(new Vector3().setFromMatrixPosition(matrix));
    }
    this.draw();
  }

  showLine(line, positions) {
    setPositions(line, positions);
    this.draw();
  }

  /** A stillmap_msgs/SubmapList. */
  showSubmaps({ submaps, loops }) {
    const places = submaps.map(({ pose: { position: { x, y, z } } }) => [x, y, z]);
    setPositions(this.graph.places, new Float32Array(places.flat()));
    setPositions(this.graph.loops, new Float32Array(loops.flatMap((loop) => [...places[loop.from_submap], ...places[loop.to_submap]])));
    this.draw();
  }

  /** Points of a scan in its own frame, with their classes; those that move are red. */
  showScan(cloud, matrix) {
    const offsets = Object.fromEntries(cloud.fields.map(({ name, offset }) => [name, offset]));
    const count = cloud.width * cloud.height;
    const view = new DataView(cloud.data.buffer, cloud.data.byteOffset, cloud.data.byteLength);
    const positions = new Float32Array(3 * count);
    const colours = new Float32Array(3 * count);
    const colour = new Color();
    for (let i = 0; i < count; ++i) {
      const at = i * cloud.point_step;
      positions[3 * i] = view.getFloat32(at + offsets.x, true);
      positions[3 * i + 1] = view.getFloat32(at + offsets.y, true);
      positions[3 * i + 2] = view.getFloat32(at + offsets.z, true);
      const isMoving = offsets.motion !== undefined && view.getUint8(at + offsets.motion) === 2;
      const label = offsets.label === undefined ? 0 : view.getUint8(at + offsets.label);
      colour.setHex(isMoving ? 0xff3030 : classes[label]?.colour ?? 0xffffff).lerp(white, isMoving ? 0 : 0.45);
      colours.set([colour.r, colour.g, colour.b], 3 * i);
    }
    setPositions(this.scan, positions);
    this.scan.geometry.setAttribute("color", new BufferAttribute(colours, 3));
    this.scan.matrix.copy(matrix);
    this.draw();
  }

  zoom(factor) {
    this.camera.position.sub(this.controls.target).multiplyScalar(factor).add(this.controls.target);
    this.controls.update();
    this.draw();
  }

  turn(radians) {
    this.camera.position.sub(this.controls.target).applyAxisAngle(this.camera.up, radians).add(this.controls.target);
    this.controls.update();
    this.draw();
  }

  fromAbove() {
    const distance = this.camera.position.distanceTo(this.controls.target);
    this.camera.position.copy(this.controls.target).add(new Vector3(0, -0.001, distance));
    this.controls.update();
    this.draw();
  }

  /** `clicked(ray)` for clicks and taps that move nothing, of one finger alone. */
  onClick(clicked) {
    const down = new Map();
    let isGesture = false;
    this.canvas.addEventListener("pointerdown", (event) => {
      // The first finger again: no other one is down.
      if (event.isPrimary) down.clear();
      isGesture = down.size > 0;
      down.set(event.pointerId, event);
    });
    this.canvas.addEventListener("pointercancel", (event) => { down.delete(event.pointerId); });
    this.canvas.addEventListener("pointerup", (event) => {
      const from = down.get(event.pointerId);
      down.delete(event.pointerId);
      if (!from || isGesture || event.button !== 0) return;
      if (Math.hypot(event.clientX - from.clientX, event.clientY - from.clientY) <= clickPixels) clicked(this.rayAt(event));
    });
  }

  rayAt({ clientX, clientY }) {
    const box = this.canvas.getBoundingClientRect();
    const caster = new Raycaster();
    caster.setFromCamera(new Vector2(2 * (clientX - box.left) / box.width - 1, 1 - 2 * (clientY - box.top) / box.height),
      this.camera);
    return caster.ray;
  }

  /** [rad] that a finger or a mouse may be off. */
  get tolerance() { return clickPixels * this.renderer.getPixelRatio() / this.pixelsPerMetre; }
}

const white = new Color(0xffffff);
