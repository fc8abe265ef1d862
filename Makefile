# Two commands do everything on a bare Debian 12: `make demo` and `make test`.
SHELL := /bin/bash
PRESET ?= release
BUILD := build/$(PRESET)
JOBS ?= $(shell nproc)
FUZZ_JOBS ?= 2
FUZZ_SECONDS ?= 600
MINUTES ?= 30
KILLS ?= 50
RECORDINGS ?=
DRIVES ?=
BASE ?= HEAD~1
PAGE ?= web
FILES ?=
TILES ?=
KILOMETRES ?=
PACKAGES := $(shell sed -e 's/\#.*//' -e '/^[[:space:]]*$$/d' debian-packages.txt)

.PHONY: help packages web-packages configure programs packaged web viewer build deb demo test test-web test-dev test-tsan test-kill test-scale test-network test-docker tidy image fuzz soak bench bench-web table1 relocalize drives loops loops-served loops-killed sessions ros-messages parity format format-check clean

# They have domains of their own, named in files; the variable would come before these.
test test-dev test-tsan test-kill test-scale test-network fuzz soak bench bench-web relocalize loops-served loops-killed parity: export ROS_DOMAIN_ID :=

help: ## Show this list
	@grep -hE '^[a-z0-9-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | awk -F '\t' '{ printf "%-16s%s\n", $$1, $$2 }'

# Slim images have no folder for manuals, and Java's package does not install without it.
packages: ## Install the Debian packages that are missing
	@missing=$$(for p in $(PACKAGES); do \
	    dpkg-query -W -f='$${Status}' $$p 2>/dev/null | grep -q 'ok installed' || echo $$p; done); \
	if [ -n "$$missing" ]; then \
	  echo "Installing:" $$missing; \
	  sudo=; [ "$$(id -u)" = 0 ] || sudo=sudo; \
	  $$sudo mkdir -p /usr/share/man/man1 && \
	  $$sudo apt-get update -q && \
	  DEBIAN_FRONTEND=noninteractive $$sudo apt-get install -yq --no-install-recommends $$missing; \
	fi

# The build configures itself again where a CMakeLists.txt changed, but does not see what was installed since.
configure: packages
	@[ -z "$(CMAKE_OPTIONS)" ] && [ $(BUILD)/build.ninja -nt CMakePresets.json ] && \
	  [ $(BUILD)/build.ninja -nt /var/lib/dpkg/status ] || cmake --preset $(PRESET) $(CMAKE_OPTIONS)

programs: configure ## Build what users run, in build/release: stillmap and stillmap-server
	cmake --build --preset $(PRESET) -j $(JOBS) --target programs

packaged: configure
	cmake --build --preset $(PRESET) -j $(JOBS) --target packaged

build: configure ## Build everything: programs, tests, benchmarks (PRESET=dev, tsan for others)
	cmake --build --preset $(PRESET) -j $(JOBS)

deb: packaged $(PAGE) ## Debian packages in build/release/packages (PAGE= leaves the web page out)
	cpack --config $(BUILD)/CPackConfig.cmake -B $(BUILD)/packages -G DEB
	rm -rf $(BUILD)/packages/_CPack_Packages
	@ls -lh $(BUILD)/packages

web: ## Bundle the page that stillmap-gateway serves, into build/release/share/stillmap/web
	@{ command -v node && command -v npm; } > /dev/null || $(MAKE) web-packages WEB_PACKAGES="nodejs npm"
	cd clients/web && { [ node_modules/.package-lock.json -nt package-lock.json ] || npm ci; } && \
	  node build.mjs $(CURDIR)/$(BUILD)/share/stillmap/web

viewer: packaged web ## A simulated drive in the browser: server, replay and gateway; the page at http://127.0.0.1:8765/
	@BUILD=$(BUILD) clients/viewer.sh

web-packages:
	sudo=; [ "$$(id -u)" = 0 ] || sudo=sudo; $$sudo apt-get update -q && \
	  DEBIAN_FRONTEND=noninteractive $$sudo apt-get install -yq --no-install-recommends $(WEB_PACKAGES)

demo: programs ## Run the main job: simulated city, replay over DDS, server, planning client
	BUILD=$(BUILD) clients/demo.sh

# Four slots a core, of which tests that mostly wait take one (tests/CMakeLists.txt).
test: configure ## Build and run the tests
	cmake --build --preset $(PRESET) -j $(JOBS) --target tested
	ctest --preset $(PRESET) -j $$((4 * $(JOBS)))

test-web: packaged web ## The gateway with Foxglove's own client, and the page in headless Chromium
	@command -v chromium > /dev/null || $(MAKE) web-packages WEB_PACKAGES=chromium
	BUILD=$(CURDIR)/$(BUILD) node --test tests/gateway/web/*.test.mjs

test-dev: ## The tests under ASan and UBSan with assertions, warnings as errors
	$(MAKE) test PRESET=dev

test-tsan: ## The tests under ThreadSanitizer
	$(MAKE) test PRESET=tsan

test-kill: build ## Kill the server at KILLS=50 random moments, also while its disk fails, and look at what is stored
	STILLMAP_KILLS=$(KILLS) $(BUILD)/tests/server/map_saver_faults_test
	STILLMAP_KILLS=$(KILLS) $(BUILD)/tests/server/kill_test

test-scale: build ## A server with TILES=100000,1000000 tiles and 512 MiB beside an empty one: start, mapping, look-ups, late joiners
	@/usr/bin/python3 tests/scale/scale.py --bin $(BUILD)/bin --tools $(BUILD)/tests/scale --maps $(BUILD)/scale --standing \
	  $(if $(TILES),--tiles $(TILES))

test-network: build ## Loss, slow links, outages, TCP, dead and late subscribers, in network namespaces
	/usr/bin/python3 tests/network/run.py --programs $(BUILD)/bin --lab $(BUILD)/tests/network

image: ## Docker image stillmap, from source
	docker/build_image.sh stillmap --build-arg JOBS=$(JOBS)

test-docker: ## Docker: the image, and the deployments of docker/ end to end (root where no dockerd runs)
	JOBS=$(JOBS) docker/test.sh

fuzz: ## Fuzz all that takes bytes from outside, FUZZ_SECONDS=600 each, FUZZ_JOBS=2 at a time (needs clang)
	@JOBS=$(FUZZ_JOBS) tests/fuzz/fuzz.sh $(FUZZ_SECONDS)

soak: build ## A server at 10 Hz for MINUTES=30, clients coming and going, dying and hanging: memory flat
	@python3 tests/soak/soak.py --bin $(BUILD)/bin --sensor $(BUILD)/tests/soak/soak_sensor --minutes $(MINUTES)

bench: build ## Benchmarks of every stage
	@for b in $(BUILD)/tests/bench/*_bench; do echo "== $$b"; $$b || exit 1; done

bench-web: build web ## The gateway with ten clients of 2 MB scans, the page with 5 million voxels in headless Chromium, Python
	@command -v chromium > /dev/null || $(MAKE) web-packages WEB_PACKAGES=chromium
	@for part in gateway page; do BUILD=$(CURDIR)/$(BUILD) node tests/gateway/web/bench.mjs $$part || exit 1; done
	@/usr/bin/python3 tests/bench/python_bench.py $(BUILD)

table1: programs ## The paper's Table I on simulated streets, crowded and quiet
	$(BUILD)/bin/stillmap evaluate weightings sim:crowd --seed 2 --scans 480
	$(BUILD)/bin/stillmap evaluate weightings sim:quiet --seed 1 --scans 500

relocalize: build ## Places of another day and of other cities, looked for in a map with no prior pose
	@for sensor in VLP-16 HDL-64E; do \
	  $(BUILD)/tests/bench/relocalization_bench --sensor $$sensor --folder $(BUILD) --scans 950 --seeds 1,2 --places 200 || exit 1; done

drives: programs ## Every drive, simulated and in RECORDINGS=FOLDER, into tests/drives/README.md: hours; goes on where it stopped
	@/usr/bin/python3 tests/drives/drives.py --program $(BUILD)/bin/stillmap --results $(BUILD)/drives \
	  $(if $(RECORDINGS),--recordings $(RECORDINGS)) $(DRIVES)

loops: programs ## Drives that come back to where they were, or KILOMETRES=50 in other cities: every closure against the truth
	@/usr/bin/python3 tests/loops/loops.py --program $(BUILD)/bin/stillmap --results $(BUILD)/loops \
	  $(if $(KILOMETRES),--kilometres $(KILOMETRES) --no-labels)

loops-served: programs ## The same drives through servers with and without loops: paths, maps, pauses
	@/usr/bin/python3 tests/loops/served.py --programs $(BUILD)/bin --results $(BUILD)/loops

loops-killed: programs ## A server dies KILLS=50 times while it corrects its map: what it had stored is one whole map
	@/usr/bin/python3 tests/loops/killed.py --programs $(BUILD)/bin --results $(BUILD)/loops --kills $(KILLS)

sessions: programs ## Drives of another day put onto a map: every pose and closure against the truth, growth, withdrawal
	@/usr/bin/python3 tests/loops/sessions.py --program $(BUILD)/bin/stillmap --results $(BUILD)/sessions

ros-messages: ## Write config/ros/stillmap_msgs, type hashes and message definitions from idl/msg
	/usr/bin/python3 config/ros/write_package.py idl/msg idl/dds/type_hash_table.inc idl/dds/message_definition_table.inc

parity: build ## Our engines against PyTorch, every RangeNet++ network and size
	PYTHONPATH=core/segmentation/training STILLMAP_TRAINING=core/segmentation/training \
	  STILLMAP=$(BUILD)/bin/stillmap /usr/bin/python3 tests/training/parity.py

tidy: programs ## clang-tidy over the sources changed since BASE (the commit before last), or over FILES (needs clang-tidy-16)
	@BUILD=$(BUILD) BASE=$(BASE) FILES="$(FILES)" tests/tidy.sh

format: ## Format the code
	set -o pipefail; git ls-files '*.cpp' '*.hpp' | xargs -r clang-format -i

format-check: ## Fail if the code is not formatted
	set -o pipefail; git ls-files '*.cpp' '*.hpp' | xargs -r clang-format --dry-run -Werror

clean: ## Remove what was built and demonstrated
	rm -rf build demo
