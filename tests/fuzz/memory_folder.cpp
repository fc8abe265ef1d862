#include "tests/fuzz/memory_folder.hpp"

#include <unistd.h>

#include <fstream>
#include <iterator>
#include <stdexcept>

namespace stillmap::fuzz {

const MemoryFolder& MemoryFolder::of_this_process() {
  static const MemoryFolder folder;
  return folder;
}

MemoryFolder::MemoryFolder() : folder_("/dev/shm/stillmap_fuzz_" + std::to_string(::getpid())) {
  std::filesystem::create_directories(folder_);
}

MemoryFolder::~MemoryFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(folder_, ignored);
}

std::filesystem::path MemoryFolder::path(const std::string& name) const { return folder_ / name; }

std::filesystem::path MemoryFolder::file(const std::string& name, Bytes bytes) const {
  const std::filesystem::path path = folder_ / name;
  std::filesystem::create_directories(path.parent_path());
  std::ofstream out(path, std::ios::binary | std::ios::trunc);
  out.write(reinterpret_cast<const char*>(bytes.data()),
            static_cast<std::streamsize>(bytes.size()));
  if (!out.flush()) throw std::runtime_error("cannot write " + path.string());
  return path;
}

std::filesystem::path MemoryFolder::file(const std::string& name, const std::string& text) const {
  return file(name, Bytes(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()));
}

void MemoryFolder::remove(const std::string& name) const {
  for (const char* ending : {"", "-wal", "-shm", "-journal"}) {
    std::error_code none_there;
    std::filesystem::remove(folder_ / (name + ending), none_there);
  }
}

std::string content_of(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) throw std::runtime_error("cannot read " + file.string());
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

}  // namespace stillmap::fuzz
