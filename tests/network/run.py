"""Plays what may happen on networks, in network namespaces, and prints a table of figures.

Every tile must arrive in the end, poses stay fresh, the server's memory stay bounded, and the
mapper be as fast as on an undisturbed network. Exit code 1 when one of these does not hold, 77
where the machine permits no network namespaces.
"""
import argparse
import os
import subprocess
import sys

import lab
import scenarios

# The machine may be busy, so the network's part is looked at: a pose's age without the mapper's time,
# and the mapper's time against that on the undisturbed network. Stalls are seconds, not milliseconds.
FRESH_MS = 300.0
FRESH_AT_THE_END_MS = 1000.0
MEMORY_GROWTH_MB = 100.0
SLOWER_MS = 50.0
# Well under half of the drive: most poses are fresh.
OUTAGE_S = 8.0

# Name, scenario, longest gap between two poses [s]; None where none are taken.
ALL = [
    ("undisturbed LAN", scenarios.undisturbed, 2.0),
    ("1 % loss, wifi", scenarios.losses(0.01), 2.0),
    ("5 % loss, wifi", scenarios.losses(0.05), 2.0),
    ("10 Mbit/s, wifi", scenarios.slow_link, 2.0),
    ("8 s outage, wifi", scenarios.outage, OUTAGE_S + 5.0),
    ("no multicast, peers", scenarios.peers_without_multicast, 2.0),
    ("no multicast, discovery server", scenarios.discovery_server, 2.0),
    ("TCP only, 1 % loss, wan", scenarios.tcp_only, 2.0),
    ("dead planner, shared memory", scenarios.dead_over_shared_memory, 2.0),
    ("dead planner, UDP", scenarios.dead_over_udp, 2.0),
    ("dead planner, TCP", scenarios.dead_over_tcp, 2.0),
    ("slow planner, shared memory", scenarios.slow_planner, 2.0),
    ("50 late joiners, LAN", scenarios.late_joiners(50), None),
]
SHORT = ("undisturbed LAN", "5 % loss, wifi", "no multicast, discovery server")


def pose_faults(poses, mapper, max_gap_s):
    if poses["count"] == 0:
        return ["no poses arrived"]
    faults = []
    if poses["p50_ms"] > mapper["p50_ms"] + FRESH_MS:
        faults.append("poses are old")
    if poses["last_ms"] > mapper["p99_ms"] + FRESH_AT_THE_END_MS:
        faults.append(f"the last pose was {poses['last_ms']:.0f} ms old")
    if poses["max_gap_s"] > max_gap_s:
        faults.append(f"no pose for {poses['max_gap_s']:.1f} s")
    return faults


def faults_of(figures, max_gap_s, undisturbed, judges_times):
    """What does not hold, in words."""
    faults = []
    mapper = figures["mapper"]
    if figures["tiles"] == 0 or figures["lacking"] > 0:
        faults.append(f"{figures['lacking']} of {figures['tiles']} tiles did not arrive")
    if figures["memory_mb"] > undisturbed["memory_mb"] + MEMORY_GROWTH_MB:
        faults.append("the server's memory grew")
    if max_gap_s is None:
        return faults  # Nobody was there while the robot drove.
    faults += pose_faults(figures["poses"], mapper, max_gap_s)
    if judges_times and mapper["p50_ms"] > 1.5 * undisturbed["mapper"]["p50_ms"] + SLOWER_MS:
        faults.append("the mapper became slower")
    if mapper["mapped"] < 0.7 * undisturbed["mapper"]["mapped"]:
        faults.append(f"only {mapper['mapped']} of {figures['published']} scans were mapped")
    return faults


HEAD = ("scenario", "tiles", "lacking", "all after", "poses", "age p50", "p99", "longest gap",
        "server", "mapper p50", "p99", "scans")


def row_of(name, figures):
    poses = figures["poses"]
    ages = ["-"] * 4 if poses["count"] == 0 else [
        str(poses["count"]), f"{poses['p50_ms']:.0f} ms", f"{poses['p99_ms']:.0f} ms",
        f"{poses['max_gap_s']:.1f} s"]
    return [name, str(figures["tiles"]), str(figures["lacking"]), f"{figures['settled_s']:.1f} s",
            *ages, f"{figures['memory_mb']:.0f} MB", f"{figures['mapper']['p50_ms']:.0f} ms",
            f"{figures['mapper']['p99_ms']:.0f} ms",
            f"{figures['mapper']['mapped']}/{figures['published']}"]


def print_row(cells):
    print("| " + " | ".join(cells) + " |", flush=True)


def record_drive(stillmap, folder, scans):
    """The recording that all drives play; made once."""
    recording = os.path.join(folder, f"city_{scans}")
    if not os.path.isdir(recording):
        subprocess.run([stillmap, "simulate", recording, "--sensor", "vlp_16", "--scans",
                        str(scans), "--seed", "5"], check=True, capture_output=True)
    return recording


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--programs", required=True, help="folder of stillmap, stillmap-server")
    parser.add_argument("--lab", required=True, help="folder of lab_robot, lab_clients")
    parser.add_argument("--short", action="store_true", help="a few scenarios, short drives")
    parser.add_argument("--slowdown", type=float, default=1.0,
                        help="of the programs, by a sanitizer: as many times fewer scans a second")
    parser.add_argument("--only", help="scenarios whose name has this text")
    arguments = parser.parse_args()
    lab.enter_namespaces([sys.executable, *sys.argv])
    scans = 60 if arguments.short else 200
    recording = record_drive(os.path.join(arguments.programs, "stillmap"), arguments.lab,
                             min(scans, 100))
    setup = scenarios.Setup(arguments.programs, arguments.lab, recording, scans,
                            scenarios.RATE_HZ / arguments.slowdown)
    print_row(HEAD)
    print_row(["---"] * len(HEAD))
    undisturbed, failed = None, False
    for name, scenario, max_gap_s in ALL:
        if arguments.short and name not in SHORT:
            continue
        if arguments.only and arguments.only not in name:
            continue
        try:
            figures = scenario(setup)
        except (RuntimeError, OSError, subprocess.CalledProcessError) as error:
            failed = True
            print(f"  FAILED: {name}: {error}", flush=True)
            if undisturbed is None:
                break  # The others are compared with it.
            continue
        undisturbed = undisturbed or figures
        print_row(row_of(name, figures))
        allowed_gap_s = max_gap_s and max_gap_s * arguments.slowdown
        # A sanitizer's own times tell nothing.
        judges_times = arguments.slowdown == 1.0
        for fault in faults_of(figures, allowed_gap_s, undisturbed, judges_times):
            failed = True
            print(f"  FAILED: {name}: {fault}", flush=True)
    raise SystemExit(1 if failed else 0)


if __name__ == "__main__":
    main()
