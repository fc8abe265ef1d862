// The program of one target, STILLMAP_FUZZ_TARGET: libFuzzer's options, or
// --seeds FOLDER, which writes the target's seeds there.

#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <fstream>
#include <string_view>

#include "tests/fuzz/fuzz_target.hpp"

namespace {

const stillmap::fuzz::Target& target = stillmap::fuzz::STILLMAP_FUZZ_TARGET;

void write_seeds(const std::filesystem::path& folder) {
  std::filesystem::create_directories(folder);
  for (const auto& [name, bytes] : target.seeds()) {
    std::ofstream out(folder / name, std::ios::binary);
    if (!(out << bytes).flush()) throw std::runtime_error("cannot write " + folder.string());
  }
}

}  // namespace

extern "C" int LLVMFuzzerInitialize(const int* argc, char*** argv) {
  if (*argc != 3 || std::string_view((*argv)[1]) != "--seeds") return 0;
  try {
    write_seeds((*argv)[2]);
  } catch (const std::exception& fault) {
    std::fprintf(stderr, "seeds of %s: %s\n", target.name, fault.what());
    std::exit(1);
  }
  std::exit(0);
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  target.run({data, size});
  return 0;
}
