"""Which drives `make drives` runs."""
import dataclasses

WEIGHTINGS = ("none", "geometric", "semantic")
MUTATIONS = ("drop", "teleport", "other_place", "cover", "cover_all", "jitter", "late")
WRONG_LABELS = ("random30", "no_movers", "buildings_move", "vegetation_moves")
PRESETS = ("quiet", "crowd")
FIRST_SEED = 101


@dataclasses.dataclass(frozen=True)
class Run:
    """One call of `stillmap evaluate drives`, or of another program on the same drive.

    Runs of one group make one row of a table for each weighting."""

    group: str
    drive: str
    scans: int
    weightings: tuple = WEIGHTINGS
    labels: str = "files"
    mutation: str = "none"
    # The true poses are good enough to tell wrong poses by.
    judged: bool = True
    # Name and path of a program that is run in place of ours.
    program: tuple = ()

    @property
    def name(self):
        parts = [self.drive, "labels=" + self.labels, "mutate=" + self.mutation, "+".join(self.weightings)]
        return " ".join([self.program[0] + ":"] + parts[:1] if self.program else parts)

    @property
    def cost(self):
        """Grows with the time that the run will take."""
        return self.scans * (1 + len(self.weightings) + 2 * (self.labels == "model"))

    def options(self):
        return [self.drive, "--labels", self.labels, "--mutate", self.mutation,
                "--weightings", *self.weightings, "--json"]


@dataclasses.dataclass(frozen=True)
class Extent:
    """How much is simulated."""

    seeds: int = 10
    mutated_seeds: int = 5
    scans: int = 200

    @classmethod
    def quick(cls):
        return cls(seeds=2, mutated_seeds=1, scans=60)


def spec(preset, seed, scans, words=""):
    return f"sim:{preset},seed={seed},scans={scans}{words}"


def simulated(extent):
    """Every preset with every motion and sensor, with true labels; the plain ones with the network's, too."""
    kinds = [("64 beams", ""), ("64 beams, rolling", ",rolling"),
             ("64 beams, hard turns", ",motion=hard_turns"),
             ("64 beams, rolling, hard turns", ",rolling,motion=hard_turns"),
             ("32 beams", ",sensor=hdl_32e"), ("16 beams", ",sensor=vlp_16"),
             ("32 beams, rolling, handheld", ",rolling,motion=handheld,sensor=hdl_32e")]
    for kind, words in kinds:
        for preset in PRESETS:
            for seed in range(FIRST_SEED, FIRST_SEED + extent.seeds):
                run = Run(f"{preset}, {kind}", spec(preset, seed, extent.scans, words), extent.scans)
                yield run
                if kind == "64 beams":
                    yield dataclasses.replace(run, labels="model")


def wrongly_labelled(extent):
    for labels in WRONG_LABELS:
        for preset in PRESETS:
            for seed in range(FIRST_SEED, FIRST_SEED + extent.mutated_seeds):
                yield Run(f"{preset}, 64 beams", spec(preset, seed, extent.scans), extent.scans,
                          weightings=("semantic",), labels=labels)


def mutated(extent):
    for mutation in MUTATIONS:
        for preset in PRESETS:
            for seed in range(FIRST_SEED, FIRST_SEED + extent.mutated_seeds):
                yield Run(f"{preset}, 64 beams", spec(preset, seed, extent.scans), extent.scans,
                          weightings=("semantic",), mutation=mutation)


def scans_of(folder):
    scans = folder / "velodyne"
    files = (scans if scans.is_dir() else folder).iterdir()
    return sum(1 for file in files if file.suffix in (".bin", ".pcd", ".ply"))


def recorded(folder, avia):
    """The recordings that are there; `avia`: where that of a Livox Avia lies, with poses_lidar.txt, or None."""
    kitti = folder / "kitti_raw_0005"
    if kitti.is_dir():
        base = Run("KITTI raw 0005, 64 beams, rolling", str(kitti), scans_of(kitti), judged=False)
        yield dataclasses.replace(base, labels="none")
        yield dataclasses.replace(base, labels="model")
    vlp16 = folder / "vlp16"
    if vlp16.is_dir():
        # No poses come with it: sharpness of the map, and what health says.
        yield Run("VLP-16, front half, turning on the spot", str(vlp16), scans_of(vlp16), labels="none",
                  judged=False)
    if avia:
        base = Run("Livox Avia, on foot", str(avia), scans_of(avia), labels="none")
        yield base
        for mutation in MUTATIONS:
            if mutation != "other_place":
                yield dataclasses.replace(base, weightings=("semantic",), mutation=mutation)


def suite(extent, recordings=None, avia=None, programs=()):
    """All runs, the plain ones first. `programs`: names and paths of other odometries."""
    runs = [*simulated(extent), *wrongly_labelled(extent), *mutated(extent)]
    if recordings:
        runs += recorded(recordings, avia)
    drives = {run.drive: run for run in runs if run.mutation == "none"}
    for program in programs:
        runs += [dataclasses.replace(run, weightings=(program[0],), labels="none", program=program)
                 for run in drives.values()]
    return runs


def weighed(runs, weightings):
    """The runs with these weightings alone; those of other programs have none of them."""
    for run in runs:
        chosen = run.weightings if run.program else tuple(w for w in run.weightings if w in weightings)
        if chosen:
            yield dataclasses.replace(run, weightings=chosen)
