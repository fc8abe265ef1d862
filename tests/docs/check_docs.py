#!/usr/bin/env python3
"""Checks the documentation against the repository and the programs.

  tests/docs/check_docs.py                            without the programs' options
  tests/docs/check_docs.py --programs build/release/bin
  tests/docs/check_docs.py --update                   copies files into the code blocks that show them

Every *.md file of the repository: relative links and anchors; `make` targets; commands and options of
stillmap and stillmap-server (by their --help), and of scripts; YAML keys; paths; names of tests,
benchmarks, topics, services, metrics and environment variables; the wire's format version; code blocks
that follow <!-- file: PATH -->; README.md's size.
Prints FILE:LINE and what is wrong; exit code 1 when anything is.

In a page, a YAML block is a part of a server file unless its info string names another kind
("yaml dds", "yaml sensor", "yaml robot", "yaml training"; "yaml prometheus" and "yaml nav2" are
not checked).
"""
import argparse
import functools
import os
import pathlib
import re
import shlex
import subprocess
import sys

README_BYTES = 15 * 1024
README_LINES = 250
PROGRAMS = ("stillmap", "stillmap-server", "stillmap-gateway")
YAML_KINDS = {
    "server": "config/server/default.yaml",
    "dds": "config/dds/lan.yaml",
    "sensor": "config/sensors/generic_example.yaml",
    "robot": "config/robots/car.yaml",
    "model": "config/models/street/model.yaml",
    "training": "core/segmentation/training/training.yaml",
}
# What looks like a YAML key and is none: sysctl's, ctest's.
OTHER_DOTTED = ("net.", "ros.", "www.")
SHELL = ("", "sh", "bash", "shell", "console")
# Words that stand for values: DRIVE, NAME, HOST:PORT.
PLACEHOLDER = re.compile(r"[A-Z]{2,}|\.\.\.|[*$<>{}]")


class Faults:
    def __init__(self):
        self.lines = []

    def add(self, page, line, text):
        self.lines.append(f"{page}:{line}: {text}")


class Page:
    """A page in parts: prose lines, inline code, and fenced blocks."""

    def __init__(self, root, path):
        self.path = path
        self.folder = (root / path).parent
        self.text = (root / path).read_text(encoding="utf-8")
        self.prose, self.blocks = [], []
        block, last_comment = None, ""
        for number, line in enumerate(self.text.splitlines(), 1):
            fence = re.match(r"\s*(```+|~~~+)\s*(.*)$", line)
            if block is None and fence:
                block = {"fence": fence[1], "info": fence[2].split(), "line": number + 1,
                         "lines": [], "comment": last_comment}
            elif block is not None and fence and fence[1].startswith(block["fence"]) and not fence[2]:
                self.blocks.append(block)
                block = None
            elif block is not None:
                block["lines"].append(line)
            else:
                self.prose.append((number, line))
            last_comment = line if line.startswith("<!--") else ""

    def inline_code(self):
        for number, line in self.prose:
            for code in re.findall(r"(?<!`)`([^`]+)`(?!`)", line):
                yield number, code.replace("\\|", "|")

    def shell_lines(self):
        for block in self.blocks:
            if (block["info"] or [""])[0] not in SHELL:
                continue
            number, text = block["line"], ""
            for offset, line in enumerate(block["lines"]):
                if not text:
                    number = block["line"] + offset
                if line.endswith("\\"):
                    text += line[:-1] + " "
                    continue
                yield number, text + line
                text = ""

    @functools.cached_property
    def anchors(self):
        """As GitHub makes them of headings."""
        seen, anchors = {}, set()
        for _, line in self.prose:
            heading = re.match(r"#{1,6}\s+(.*?)\s*#*$", line)
            if not heading:
                continue
            text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading[1])
            slug = re.sub(r"[^\w\- ]", "", text.lower()).replace(" ", "-")
            count = seen.get(slug, 0)
            seen[slug] = count + 1
            anchors.add(slug if count == 0 else f"{slug}-{count}")
        anchors.update(re.findall(r'<a (?:id|name)="([^"]+)"', self.text))
        return anchors


def files_of(root):
    """Repository files, new ones included, without build outputs."""
    try:
        listed = subprocess.run(
            ["git", "-C", str(root), "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
            check=True, capture_output=True).stdout.decode().split("\0")
        files = {name for name in listed if name and (root / name).exists()}
        if files:
            return files
    except (OSError, subprocess.CalledProcessError):
        pass
    files = set()
    for folder, folders, names in os.walk(root):
        folders[:] = [name for name in folders if name not in (".git", "build", "demo", "__pycache__")]
        files.update(str(pathlib.Path(folder, name).relative_to(root)) for name in names)
    return files


class Repository:
    def __init__(self, root):
        self.root = root
        self.files = files_of(root)
        self.folders = {str(parent) for name in self.files for parent in pathlib.PurePath(name).parents}
        self.pages = {name: Page(root, name) for name in sorted(self.files) if name.endswith(".md")}
        self.top = {name.split("/")[0] for name in self.files if "/" in name}

    def read(self, name):
        return (self.root / name).read_text(encoding="utf-8", errors="replace")

    def exists(self, path):
        path = os.path.normpath(path)
        return path in self.files or path in self.folders or path == "."

    @functools.cached_property
    def make_targets(self):
        return set(re.findall(r"^([A-Za-z0-9_-]+):(?!=)", self.read("Makefile"), re.M))

    @functools.cached_property
    def test_programs(self):
        """Programs that tests/ builds: NAME_test, NAME_bench and those of add_executable."""
        names = set()
        for file in self.files:
            if not (file.startswith("tests/") and file.endswith("CMakeLists.txt")):
                continue
            text = self.read(file)
            names.update(f"{name}_{kind}" for kind, name in
                         re.findall(r"stillmap_(test|bench)\(\s*(\w+)", text))
            names.update(re.findall(r"add_executable\(\s*(\w+)", text))
        return names

    @functools.cached_property
    def test_suites(self):
        suites = set()
        for file in self.files:
            if file.startswith("tests/") and file.endswith(".cpp"):
                suites.update(re.findall(r"TEST(?:_F|_P)?\(\s*(\w+)", self.read(file)))
        return suites

    @functools.cached_property
    def format_version(self):
        for file in self.files:
            if file.startswith("idl/") and file.endswith((".hpp", ".cpp")):
                found = re.search(r"wire_format_version\s*=\s*(\d+)", self.read(file))
                if found:
                    return found[1]
        return None

    def sources(self, folders, endings):
        return "".join(self.read(name) for name in sorted(self.files)
                       if name.startswith(folders) and name.endswith(endings)
                       and not name.startswith("tests/docs/"))

    @functools.cached_property
    def variables(self):
        """Environment variables and CMake options that sources and scripts know."""
        text = self.sources(("",), (".cpp", ".hpp", ".py", ".sh", ".txt", ".cmake", ".in", "Makefile",
                                    "Dockerfile", ".json"))
        text += self.sources(("docker/",), (".yaml",))
        return set(re.findall(r"STILLMAP_[A-Z0-9_]+", text))

    @functools.cached_property
    def wire_names(self):
        """String literals of idl/: names of topics and services among them."""
        return set(re.findall(r'"([\w/]+)"', self.sources(("idl/",), (".cpp", ".hpp"))))

    @functools.cached_property
    def metrics(self):
        names = set(re.findall(r'"([a-z_]+)"', self.sources(("server/",), (".cpp", ".hpp"))))
        return names | {"stillmap_" + name for name in names}

    @functools.cached_property
    def yaml_keys(self):
        return {kind: set(keys_of(self.read(file).splitlines()))
                for kind, file in YAML_KINDS.items() if file in self.files}


def split_top(text, separator):
    """Splits at separators outside brackets."""
    parts, depth, start = [], 0, 0
    for i, char in enumerate(text):
        depth += char in "[{"
        depth -= char in "]}"
        if char == separator and depth == 0:
            parts.append(text[start:i])
            start = i + 1
    return parts + [text[start:]]


def flow_keys(text, prefix):
    """Key paths of {a: 1, b: {c: 2}}."""
    text = text.strip()
    if not (text.startswith("{") and text.endswith("}")):
        return
    for part in split_top(text[1:-1], ","):
        key, colon, value = part.partition(":")
        if colon:
            path = prefix + key.strip()
            yield path
            yield from flow_keys(value, path + ".")


def keys_with_lines(lines):
    """(line, path) of a YAML file's mappings; what is in lists is left out."""
    open_keys = []
    for number, line in enumerate(lines):
        match = re.match(r"( *)([\w-]+):(?:\s+(.*?))?\s*$", re.sub(r"(^|\s)#.*", "", line).rstrip())
        if not match:
            continue
        indent, key, value = len(match[1]), match[2], match[3] or ""
        while open_keys and open_keys[-1][0] >= indent:
            open_keys.pop()
        path = ".".join([name for _, name in open_keys] + [key])
        yield number, path
        for inner in flow_keys(value, path + "."):
            yield number, inner
        open_keys.append((indent, key))


def keys_of(lines):
    return [path for _, path in keys_with_lines(lines)]


class Help:
    """Commands and options of a program, as its --help tells them."""

    def __init__(self, program):
        self.program = program

    @functools.lru_cache(maxsize=None)
    def text(self, commands):
        run = subprocess.run([str(self.program), *commands, "--help"], capture_output=True, text=True,
                             timeout=60, check=False)
        return run.stdout if run.returncode == 0 else None

    @functools.lru_cache(maxsize=None)
    def commands(self, path):
        names, inside = set(), False
        for line in (self.text(path) or "").splitlines():
            if re.match(r"\S.*:$", line):
                inside = line.lower().startswith(("subcommands", "commands"))
            elif inside:
                name = re.match(r"\s{1,4}([a-z][\w-]*)(\s|$)", line)
                if name:
                    names.add(name[1])
        return names

    @functools.lru_cache(maxsize=None)
    def options(self, path):
        options = set()
        for line in (self.text(path) or "").splitlines():
            entry = re.match(r"\s+((?:-{1,2}[\w-]+(?:\{[^}]*\})?,?\s?)+)", line)
            if entry:
                options.update(re.findall(r"(?<![\w-])--?[A-Za-z][\w-]*", entry[1]))
        return options | {"--help", "-h"}

    def all_options(self):
        paths, found = [()], set()
        while paths:
            path = paths.pop()
            found |= self.options(path)
            paths += [(*path, name) for name in self.commands(path)]
        return found


def words_of(command):
    try:
        return shlex.split(command, comments=True)
    except ValueError:
        return re.sub(r"\s#.*", "", command).split()


def commands_in(line):
    """The commands of a shell line, each as its words, without what only sets it up."""
    words = words_of(re.sub(r"(&&|\|\||[;|&])", r" \1 ", line))
    command = []
    for word in words + [";"]:
        if word in ("&&", "||", ";", "|", "&"):
            while command and (re.match(r"[A-Z_]+=", command[0]) or command[0] in ("sudo", "exec", "!")):
                command.pop(0)
            if command:
                yield command
            command = []
        else:
            command.append(word)


class Checks:
    def __init__(self, repository, programs, faults):
        self.repository = repository
        self.faults = faults
        self.help = {}
        if programs:
            self.help = {name: Help(programs / name) for name in PROGRAMS}
        self.all_options = set().union(*(help.all_options() for help in self.help.values()), set())

    def run(self):
        for page in self.repository.pages.values():
            self.links(page)
            self.blocks(page)
            for number, line in page.shell_lines():
                for command in commands_in(line):
                    self.command(page, number, command)
            for number, code in page.inline_code():
                self.inline(page, number, code)
            for number, line in enumerate(page.text.splitlines(), 1):
                for variable in re.findall(r"STILLMAP_[A-Z0-9_]+", line):
                    if variable not in self.repository.variables:
                        self.faults.add(page.path, number, f"{variable}: nothing reads it")
                version = re.search(r"format_version: (\d+)", line)
                if version and version[1] != (self.repository.format_version or version[1]):
                    self.faults.add(page.path, number, f"format_version {version[1]}: the wire's is "
                                                       f"{self.repository.format_version}")
        self.size()

    def links(self, page):
        for number, line in page.prose:
            bare = re.sub(r"`[^`]*`", lambda code: "x" * len(code[0]), line)
            targets = re.findall(r"\[(?:[^\[\]]|\[[^\]]*\])*\]\(([^()\s]+)(?:\s+\"[^\"]*\")?\)", bare)
            targets += re.findall(r"^\[[^\]]+\]:\s*(\S+)", bare)
            targets += re.findall(r'(?:href|src)="([^"]+)"', bare)
            for target in targets:
                if re.match(r"[a-z][a-z0-9+.-]*:", target):
                    continue
                path, _, anchor = target.partition("#")
                found = page.path
                if path:
                    found = os.path.normpath(os.path.join(os.path.dirname(page.path), path))
                    if not self.repository.exists(found):
                        self.faults.add(page.path, number, f"link {target}: there is no {found}")
                        continue
                if anchor and found in self.repository.pages:
                    if anchor not in self.repository.pages[found].anchors:
                        self.faults.add(page.path, number, f"link {target}: {found} has no #{anchor}")

    def blocks(self, page):
        for block in page.blocks:
            source = re.match(r"<!-- file: (\S+) -->", block["comment"])
            if source:
                self.copied(page, block, source[1])
            if block["info"][:1] == ["yaml"]:
                kind = (block["info"] + ["server"])[1]
                known = self.repository.yaml_keys.get(kind)
                for offset, key in keys_with_lines(block["lines"]) if known else []:
                    if key not in known and not self.is_open(key):
                        self.faults.add(page.path, block["line"] + offset,
                                        f"YAML key {key}: not in {YAML_KINDS[kind]}")

    @staticmethod
    def is_open(key):
        return key.startswith(("class_cost.", "classes."))

    def copied(self, page, block, source):
        if source not in self.repository.files:
            self.faults.add(page.path, block["line"], f"shows {source}, which is not there")
            return
        if "\n".join(block["lines"]).strip() != self.repository.read(source).strip():
            self.faults.add(page.path, block["line"],
                            f"is not {source} as it is now (check_docs.py --update copies it)")

    def inline(self, page, number, code):
        words = words_of(code)
        if not words:
            return
        first = os.path.basename(words[0])
        if first in PROGRAMS or first in ("make", "sudo") or first.endswith((".py", ".sh", "_test", "_bench")):
            for command in commands_in(code):
                self.command(page, number, command)
        elif first.startswith("--"):
            for word in words:
                option = word.split("=")[0]
                if option.startswith("--") and self.help and option not in self.all_options:
                    if not self.option_of_tool(option):
                        self.faults.add(page.path, number, f"{option}: no command has it")
        self.dotted_key(page, number, code)
        name = re.fullmatch(r"/?stillmap/(\w+)", code)
        if name and name[1] not in self.repository.wire_names:
            self.faults.add(page.path, number, f"{code}: idl/ has no such topic or service")
        metric = re.fullmatch(r"(stillmap|process)_(?!server$|msgs$)[a-z_]+", code)
        if metric and code not in self.repository.metrics:
            self.faults.add(page.path, number, f"{code}: server/ has no such metric")
        for word in words:
            self.path(page, number, word)

    def option_of_tool(self, option):
        """Of a script of ours."""
        whole = re.compile(re.escape(option) + r"(?![\w-])")
        return any(whole.search(self.repository.read(name)) for name in self.repository.files
                   if name.endswith((".py", ".sh")) and not name.startswith("tests/docs/"))

    def dotted_key(self, page, number, code):
        match = re.match(r"([a-z_]+(?:\.[a-z][a-z0-9_]*)+)(?=$|[:\s=])", code)
        if not match or "/" in code or match[1].startswith(OTHER_DOTTED):
            return
        key = match[1]
        if key in self.repository.files or any(name.endswith("/" + key) for name in self.repository.files):
            return
        if any(key in keys for keys in self.repository.yaml_keys.values()):
            return
        if re.search(r"\.(stillmap|ya?ml|onnx|txt|png|ply|pcd|json|csv|pgm|bin|db3|label|msg)$", key):
            return
        self.faults.add(page.path, number, f"{key}: no configuration file has this key")

    def path(self, page, number, word):
        """Repository paths: their first folder is one of the repository's."""
        word = word.strip(".,;:()").removeprefix("./")
        if "/" not in word or word.startswith(("/", "-", "$")) or PLACEHOLDER.search(word):
            return
        if word.split("/")[0] not in self.repository.top or word.startswith("docker/packages"):
            return
        if not self.repository.exists(word):
            self.faults.add(page.path, number, f"{word}: there is no such file or folder")

    def command(self, page, number, words):
        name = os.path.basename(words[0])
        if name == "make":
            self.make(page, number, words[1:])
        elif name in PROGRAMS:
            self.program(page, number, name, words[1:])
        elif name.endswith((".py", ".sh")):
            self.script(page, number, name, words)
        elif name.endswith(("_test", "_bench")):
            self.test(page, number, name, words[1:])
        for word in words:
            if "=" not in word:
                self.path(page, number, word)

    def make(self, page, number, words):
        for word in words:
            if word.startswith("-") or "=" in word or PLACEHOLDER.search(word):
                continue
            if word not in self.repository.make_targets:
                self.faults.add(page.path, number, f"make {word}: Makefile has no such target")

    def program(self, page, number, name, words):
        if not self.help:
            return
        help, path = self.help[name], ()
        for word in words:
            if word.startswith("-") and not re.match(r"-?[\d.]", word):
                option = word.split("=")[0]
                if option not in help.options(path):
                    self.faults.add(page.path, number,
                                    f"{' '.join((name, *path))} has no option {option}")
            elif help.commands(path):
                if PLACEHOLDER.search(word):
                    return
                if word not in help.commands(path):
                    self.faults.add(page.path, number, f"{' '.join((name, *path))} has no command {word}")
                    return
                path = (*path, word)

    def script(self, page, number, name, words):
        sources = [file for file in self.repository.files if os.path.basename(file) == name]
        if not sources:
            self.faults.add(page.path, number, f"{words[0]}: there is no such script")
            return
        text = "".join(self.repository.read(file) for file in sources)
        for word in words[1:]:
            option = word.split("=")[0]
            if option.startswith("--") and option not in text:
                self.faults.add(page.path, number, f"{name} has no option {option}")

    def test(self, page, number, name, words):
        if name not in self.repository.test_programs:
            self.faults.add(page.path, number, f"{name}: tests/ builds no such program")
        for word in words:
            pattern = word.partition("--gtest_filter=")[2]
            if not pattern:
                continue
            suite = re.escape(pattern.split(".")[0]).replace(r"\*", ".*")
            if not any(re.fullmatch(suite, known) for known in self.repository.test_suites):
                self.faults.add(page.path, number, f"{word}: no test has such a name")

    def size(self):
        readme = self.repository.pages.get("README.md")
        if readme is None:
            self.faults.add("README.md", 1, "is missing")
            return
        size, lines = len(readme.text.encode()), len(readme.text.splitlines())
        if size > README_BYTES:
            self.faults.add("README.md", 1, f"has {size} bytes; at most {README_BYTES}")
        if lines > README_LINES:
            self.faults.add("README.md", README_LINES, f"has {lines} lines; at most {README_LINES}")


def update(repository):
    """Copies files into the code blocks that show them."""
    pattern = re.compile(r"(<!-- file: (\S+) -->\n(```+)\w*\n)(.*?)(\n\3\n)", re.S)
    for name, page in repository.pages.items():
        def copy(match):
            if match[2] not in repository.files:
                return match[0]
            return match[1] + repository.read(match[2]).rstrip("\n") + match[5]
        text = pattern.sub(copy, page.text)
        if text != page.text:
            (repository.root / name).write_text(text, encoding="utf-8")
            print(f"{name}: updated")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--root", type=pathlib.Path, default=pathlib.Path(__file__).resolve().parents[2])
    parser.add_argument("--programs", type=pathlib.Path, help="folder of stillmap and stillmap-server")
    parser.add_argument("--update", action="store_true", help="copy files into the blocks that show them")
    arguments = parser.parse_args()
    repository = Repository(arguments.root.resolve())
    if arguments.update:
        update(repository)
        return 0
    faults = Faults()
    if arguments.programs:
        for name in PROGRAMS:
            if not (arguments.programs / name).exists():
                print(f"{arguments.programs / name} is missing: build it first", file=sys.stderr)
                return 2
    Checks(repository, arguments.programs, faults).run()
    for line in faults.lines:
        print(line)
    print(f"{len(repository.pages)} pages, {len(faults.lines)} faults")
    return 1 if faults.lines else 0


if __name__ == "__main__":
    sys.exit(main())
