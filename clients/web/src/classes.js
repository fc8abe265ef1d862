// SemanticKITTI's classes with their colours, in the order of their numbers on the wire.
export const classes = [
  ["unlabeled", 0x606060], ["car", 0x6496f5], ["bicycle", 0x64e6f5], ["motorcycle", 0x1e3c96],
  ["truck", 0x501eb4], ["other-vehicle", 0x0000ff], ["person", 0xff1e1e], ["bicyclist", 0xff28c8],
  ["motorcyclist", 0x961e5a], ["road", 0xff00ff], ["parking", 0xff96ff], ["sidewalk", 0x4b004b],
  ["other-ground", 0xaf004b], ["building", 0xffc800], ["fence", 0xff7832], ["vegetation", 0x00af00],
  ["trunk", 0x873c00], ["terrain", 0x96f050], ["pole", 0xfff096], ["traffic-sign", 0xff0000],
].map(([name, colour]) => ({ name, colour }));

export const className = (label) => classes[label]?.name ?? `class ${label}`;

// Of GetRemoved.reason.
export const removalReasons = ["moving", "semi-static", "seen through", "relabelled"];

// Of TraversabilityGrid.reason.
export const blockReasons = ["", "obstacle", "low headroom", "step", "slope", "roughness", "ground class",
  "too near to something lethal", "unknown"];
