"""A network in network namespaces: hosts on a switch, links that lose packets, are slow or are cut.

Works without root where the kernel lets users have namespaces of their own.
"""
import json
import os
import shutil
import signal
import subprocess
import tempfile
import time

NOT_PERMITTED = 77  # ctest's SKIP_RETURN_CODE
INSIDE = "STILLMAP_LAB_INSIDE"


def enter_namespaces(argv):
    """Starts this program again in namespaces of its own; returns there only."""
    if os.environ.get(INSIDE):
        os.makedirs("/run/netns", exist_ok=True)
        return
    for tool in ("ip", "tc", "iptables", "unshare"):
        if shutil.which(tool) is None:
            print(f"skipped: the program '{tool}' is missing (packages iproute2, iptables)")
            raise SystemExit(NOT_PERMITTED)
    unshare = ["unshare", "--user", "--map-root-user", "--net", "--mount"]
    probe = "mount -t tmpfs none /run && ip netns add probe && ip link add link0 type bridge"
    if subprocess.run(unshare + ["sh", "-c", probe], capture_output=True).returncode != 0:
        print("skipped: this machine does not permit network namespaces "
              "(sysctl kernel.unprivileged_userns_clone, or run as root)")
        raise SystemExit(NOT_PERMITTED)
    inside = ["sh", "-c", 'mount -t tmpfs none /run && exec "$@"', "lab"]
    os.execvpe("unshare", unshare + inside + argv, {**os.environ, INSIDE: "1"})


def run(*words):
    subprocess.run(words, check=True, capture_output=True)


class Host:
    """A machine with one cable to the switch."""

    def __init__(self, lab, name, number):
        self.lab, self.name = lab, name
        self.address = f"10.41.0.{number}"
        self.port = f"port_{name}"
        run("ip", "netns", "add", name)
        run("ip", "link", "add", self.port, "type", "veth", "peer", "name", "eth0", "netns", name)
        run("ip", "link", "set", self.port, "master", "switch", "up")
        self.inside("ip", "link", "set", "lo", "up")
        self.inside("ip", "addr", "add", f"{self.address}/24", "dev", "eth0")
        self.inside("ip", "link", "set", "eth0", "up")
        self.inside("ip", "route", "add", "default", "dev", "eth0")  # for multicast

    def inside(self, *words):
        run("ip", "netns", "exec", self.name, *words)

    def drop(self, *what):
        """Packets on their way in; before the kernel puts fragments together."""
        self.inside("iptables", "-t", "raw", "-A", "PREROUTING", "!", "-i", "lo", *what,
                    "-j", "DROP")

    def lose(self, share):
        """Of the packets in either direction, without a word to who sends them."""
        chance = ("-m", "statistic", "--mode", "random", "--probability", str(share))
        self.drop(*chance)
        for other in self.lab.hosts.values():
            if other is not self:
                other.drop("-s", self.address, *chance)

    def limit(self, mbit_per_s):
        """The rate of the cable in both directions; a router's queue holds 50 ms."""
        shape = ["root", "tbf", "rate", f"{mbit_per_s}mbit", "burst", "32k", "latency", "50ms"]
        run("tc", "qdisc", "replace", "dev", self.port, *shape)
        self.inside("tc", "qdisc", "replace", "dev", "eth0", *shape)

    def cut(self):
        run("ip", "link", "set", self.port, "nomaster")

    def mend(self):
        run("ip", "link", "set", self.port, "master", "switch")

    def refuse_multicast(self):
        self.drop("-d", "224.0.0.0/4")

    def refuse_udp(self):
        self.drop("-p", "udp")

    def traffic_bytes(self):
        """Sent to this host so far."""
        shown = subprocess.run(["ip", "-s", "-j", "link", "show", self.port], check=True,
                               capture_output=True, text=True)
        return json.loads(shown.stdout)[0]["stats64"]["tx"]["bytes"]

    def start(self, *words):
        return self.lab.start(["ip", "netns", "exec", self.name, *words])


class Program:
    """A process that ends with the lab."""

    def __init__(self, words, log, environment):
        self.log = log
        self.out = open(log, "w")
        self.err = open(str(log) + ".err", "w")
        self.process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=self.out,
                                        stderr=self.err, env=environment)

    def end_input(self):
        self.process.stdin.close()

    def signal(self, number):
        self.process.send_signal(number)

    def wait(self, seconds):
        try:
            return self.process.wait(seconds)
        except subprocess.TimeoutExpired:
            return None

    def text(self):
        with open(self.log) as out, open(str(self.log) + ".err") as err:
            return out.read() + err.read()

    def wait_for_text(self, text, seconds):
        end = time.monotonic() + seconds
        while text not in self.text():
            if time.monotonic() > end or self.process.poll() is not None:
                raise RuntimeError(f"'{text}' did not come from {self.log}:\n{self.text()}")
            time.sleep(0.05)

    def result(self, seconds):
        """The JSON line that it printed at its end."""
        if self.wait(seconds) is None:
            raise RuntimeError(f"{self.log} did not end within {seconds} s:\n{self.text()}")
        with open(self.log) as out:
            lines = [line for line in out if line.startswith("{")]
        if not lines:
            raise RuntimeError(f"no result in {self.log}:\n{self.text()}")
        return json.loads(lines[-1])

    def resident_mb(self):
        """None once it has ended."""
        try:
            with open(f"/proc/{self.process.pid}/status") as status:
                for line in status:
                    if line.startswith("VmRSS"):
                        return int(line.split()[1]) / 1024
        except FileNotFoundError:
            pass
        return None

    def end(self):
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGCONT)
            self.process.terminate()
            if self.wait(15) is None:
                self.process.kill()
                self.process.wait()
        self.out.close()
        self.err.close()


class Lab:
    """A switch, hosts and programs; all of it goes with the `with` block."""

    def __init__(self, environment=None):
        self.environment = {**os.environ, **(environment or {})}
        self.hosts, self.programs = {}, []

    def __enter__(self):
        self.folder = tempfile.mkdtemp(prefix="stillmap_network_")
        run("ip", "link", "add", "switch", "type", "bridge", "mcast_snooping", "0")
        run("ip", "link", "set", "switch", "up")
        return self

    def __exit__(self, *_):
        for program in reversed(self.programs):
            program.end()
        for host in self.hosts.values():
            # The kernel removes a namespace and its cable some time later; the next lab's has the
            # same name.
            subprocess.run(["ip", "link", "del", host.port], capture_output=True)
            subprocess.run(["ip", "netns", "del", host.name], capture_output=True)
        run("ip", "link", "del", "switch")
        shutil.rmtree(self.folder)

    def host(self, name):
        self.hosts[name] = Host(self, name, len(self.hosts) + 1)
        return self.hosts[name]

    def start(self, words):
        log = os.path.join(self.folder, f"{len(self.programs)}_{os.path.basename(words[4])}.log")
        self.programs.append(Program(words, log, self.environment))
        return self.programs[-1]
