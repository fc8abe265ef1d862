// Where things are: the robot's poses, frames, and the path with its times.
import { Matrix4, Quaternion, Vector3 } from "three";

export const nanoseconds = ({ sec, nsec }) => BigInt(sec) * 1000000000n + BigInt(nsec);

export function matrixOf({ translation, rotation }) {
  return new Matrix4().compose(new Vector3(translation.x, translation.y, translation.z),
    new Quaternion(rotation.x, rotation.y, rotation.z, rotation.w), new Vector3(1, 1, 1));
}

export function matrixOfPose({ position, orientation }) {
  return matrixOf({ translation: position, rotation: orientation });
}

const rememberedPoses = 100;
const longestChain = 20;

/** T_parent_child of every frame but the moving one, and the robot's last poses by their stamps. */
export class Frames {
  #fixed = new Map();
  #poses = new Map();
  base = undefined;
  map = "map";
  newest = undefined;

  addTransforms({ transforms }) {
    for (const { header, child_frame_id, transform } of transforms) {
      this.#fixed.set(child_frame_id, { parent: header.frame_id, matrix: matrixOf(transform) });
    }
  }

  addOdometry({ header, child_frame_id, pose }) {
    this.base = child_frame_id;
    this.map = header.frame_id;
    this.newest = { stamp: nanoseconds(header.stamp), matrix: matrixOfPose(pose.pose) };
    this.#poses.set(this.newest.stamp, this.newest.matrix);
    if (this.#poses.size > rememberedPoses) this.#poses.delete(this.#poses.keys().next().value);
  }

  /** T_map_frame at a stamp; undefined where it is not known. */
  at(frame, stamp) {
    const inBase = this.#inBase(frame);
    const base = this.#poses.get(stamp) ?? this.newest?.matrix;
    return inBase && base ? base.clone().multiply(inBase) : undefined;
  }

  #inBase(frame) {
    const matrix = new Matrix4();
    for (let i = 0; i < longestChain && frame !== this.base; ++i) {
      const link = this.#fixed.get(frame);
      if (!link) return undefined;
      matrix.premultiply(link.matrix);
      frame = link.parent;
    }
    return frame === this.base ? matrix : undefined;
  }
}
