"""What may happen on a network, played with real processes; each scenario returns its figures."""
import os
import signal
import threading
import time

from lab import Lab

DOMAIN = "41"
RATE_HZ = 10.0
SHARED_MEMORY = ["--dds-profile",
                 os.path.join(os.path.dirname(os.path.abspath(__file__)), "shared_memory.yaml")]


class Setup:
    """Where the programs are, and how long a drive is."""

    def __init__(self, programs, lab_programs, recording, scans, rate_hz=RATE_HZ):
        self.stillmap = os.path.join(programs, "stillmap")
        self.server = os.path.join(programs, "stillmap-server")
        self.robot = os.path.join(lab_programs, "lab_robot")
        self.clients = os.path.join(lab_programs, "lab_clients")
        self.recording = recording
        self.scans = scans
        self.rate_hz = rate_hz

    @property
    def drive_s(self):
        return self.scans / self.rate_hz


class Watch(threading.Thread):
    """Samples a program's memory until its end or stop()."""

    def __init__(self, program):
        super().__init__(daemon=True)
        self.program, self.peak_mb = program, 0.0
        self.done = threading.Event()
        self.start()

    def run(self):
        while not self.done.wait(0.25):
            now_mb = self.program.resident_mb()
            if now_mb is None:
                return
            self.peak_mb = max(self.peak_mb, now_mb)

    def stop(self):
        self.done.set()
        self.join()
        return self.peak_mb


class Drive:
    """A server and its robot on host `robot`, planners elsewhere."""

    def __init__(self, lab, setup, flags):
        self.lab, self.setup, self.flags = lab, setup, flags
        self.home = lab.host("robot")
        config = os.path.join(lab.folder, "server.yaml")
        with open(config, "w") as file:
            file.write(f"sensor: vlp_16\nlabels: {{source: stream}}\ndds: {{domain_id: {DOMAIN}}}\n"
                       "publish: {scan: false}\noccupancy: {enabled: false}\n"
                       "traversability: {profiles: [], grid_profile: ''}\n")
        self.server = self.home.start(setup.server, "--config", config, *flags)
        self.server.wait_for_text("ready", 30)
        self.memory = Watch(self.server)

    def planners(self, host, *words, flags=None, settle_s=60.0, ready=True):
        planners = host.start(self.setup.clients, "--domain", DOMAIN, "--timeout", "60",
                              "--settle", str(settle_s),
                              *(self.flags if flags is None else flags), *words)
        if ready:
            planners.wait_for_text("ready", 90)
        return planners

    def start_robot(self, flags=None):
        self.robot = self.home.start(self.setup.robot, self.setup.recording, "--scans",
                                     str(self.setup.scans), "--rate", str(self.setup.rate_hz), "--domain",
                                     DOMAIN, "--timeout", "60",
                                     *(self.flags if flags is None else flags))
        self.robot.wait_for_text("driving", 60)

    def end_robot(self):
        return self.robot.result(self.setup.drive_s + 90)["published"]

    def figures(self, planners, published):
        """Of a drive that has ended."""
        planners.end_input()
        result = planners.result(300)
        return {**result, "memory_mb": self.memory.stop(), "published": published}


def drive(setup, flags, hinder=None, during=None, client_flags=None, prepare=None, local=None):
    """The usual drive with one planner on host `office`, whose cable `hinder` spoils."""
    with Lab() as lab:
        if prepare:
            prepare(lab)
        play = Drive(lab, setup, flags)
        office = lab.host("office")
        if hinder:
            hinder(play.home, office)
        planners = play.planners(office, flags=client_flags)
        play.start_robot(local)
        if during:
            during(play, office)
        return play.figures(planners, play.end_robot())


def undisturbed(setup):
    return drive(setup, ["--dds-profile", "lan"])


def losses(share):
    def scenario(setup):
        return drive(setup, ["--dds-profile", "wifi"], lambda home, office: office.lose(share))
    return scenario


def slow_link(setup):
    return drive(setup, ["--dds-profile", "wifi"], lambda home, office: office.limit(10))


def outage(setup):
    def cut_the_cable(play, office):
        time.sleep(3)
        office.cut()
        time.sleep(8)
        office.mend()
    return drive(setup, ["--dds-profile", "wifi"], during=cut_the_cable)


def refuse_multicast(home, office):
    home.refuse_multicast()
    office.refuse_multicast()


def peers_without_multicast(setup):
    profile = ["--dds-profile", "no_multicast"]
    return drive(setup, profile, refuse_multicast, client_flags=profile + ["--peer", "10.41.0.1"])


def discovery_server(setup):
    flags = ["--dds-profile", "no_multicast", "--discovery-server", "10.41.0.1"]

    def prepare(lab):
        desk = lab.host("desk")
        desk.refuse_multicast()
        desk.start(setup.stillmap, "discovery-server", "--domain",
                   DOMAIN).wait_for_text("discovery server", 30)
    return drive(setup, flags, refuse_multicast, prepare=prepare)


def tcp_only(setup):
    def hinder(home, office):
        home.refuse_udp()
        office.refuse_udp()
        office.lose(0.01)
    flags = ["--dds-profile", "wan"]
    return drive(setup, flags, hinder, client_flags=flags + ["--peer", "10.41.0.1"],
                 local=flags + ["--peer", "127.0.0.1"])


def beside(setup, flags, make_other, client_flags=None, local=None):
    """A drive with a well-behaved planner, and another one that `make_other` starts."""
    client_flags = flags if client_flags is None else client_flags
    with Lab() as lab:
        play = Drive(lab, setup, flags)
        office = lab.host("office")
        planners = play.planners(office, flags=client_flags)
        other = make_other(play, lab, client_flags)
        play.start_robot(local)
        figures = play.figures(planners, play.end_robot())
        other.signal(signal.SIGCONT)
        return figures


def stopped(program):
    time.sleep(1.0)
    program.signal(signal.SIGSTOP)
    return program


def dead_over_shared_memory(setup):
    return beside(setup, ["--dds-profile", "lan"],
                  lambda play, lab, flags: stopped(play.planners(play.home, flags=SHARED_MEMORY,
                                                                 settle_s=1)))


def dead_over_udp(setup):
    return beside(setup, ["--dds-profile", "lan"],
                  lambda play, lab, flags: stopped(play.planners(lab.host("attic"), settle_s=1)))


def dead_over_tcp(setup):
    flags = ["--dds-profile", "wan"]
    return beside(setup, flags,
                  lambda play, lab, its: stopped(play.planners(lab.host("attic"), flags=its,
                                                               settle_s=1)),
                  client_flags=flags + ["--peer", "10.41.0.1"],
                  local=flags + ["--peer", "127.0.0.1"])


def slow_planner(setup):
    return beside(setup, ["--dds-profile", "lan"],
                  lambda play, lab, flags: play.planners(play.home, "--busy-ms", "300",
                                                         flags=SHARED_MEMORY, settle_s=1))


def late_joiners(count):
    def scenario(setup):
        with Lab() as lab:
            flags = ["--dds-profile", "lan"]
            play = Drive(lab, setup, flags)
            play.start_robot()
            published = play.end_robot()
            office = lab.host("office")
            began = time.monotonic()
            planners = play.planners(office, "--count", str(count), "--no-poses",
                                     settle_s=120.0, ready=False)
            figures = play.figures(planners, published)
            figures.update(settled_s=time.monotonic() - began,
                           sent_mb=office.traffic_bytes() / 1e6)
            return figures
    return scenario
