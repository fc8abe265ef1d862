#include "idl/bag/input_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string>

#include "core/dataset/dataset_error.hpp"

namespace stillmap::dds {

InputFile::InputFile(const std::filesystem::path& file)
    : path_(file), descriptor_(::open(file.c_str(), O_RDONLY | O_CLOEXEC)) {
  struct stat about {};
  if (descriptor_ < 0 || fstat(descriptor_, &about) != 0) {
    const std::string fault = std::strerror(errno);
    if (descriptor_ >= 0) ::close(descriptor_);
    throw DatasetError(file, "cannot be read: " + fault + "; check the path and its permissions");
  }
  if (!S_ISREG(about.st_mode)) {
    ::close(descriptor_);
    throw DatasetError(file, "no such file; check the path");
  }
  size_ = static_cast<std::uint64_t>(about.st_size);
}

InputFile::~InputFile() { ::close(descriptor_); }

void InputFile::read(std::uint64_t offset, std::span<std::uint8_t> to) const {
  while (!to.empty()) {
    const ssize_t got = ::pread(descriptor_, to.data(), to.size(), static_cast<off_t>(offset));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) throw DatasetError(path_, std::string("cannot be read: ") + std::strerror(errno));
    if (got == 0) throw DatasetError(path_, "ends before byte " + std::to_string(offset));
    offset += static_cast<std::uint64_t>(got);
    to = to.subspan(static_cast<std::size_t>(got));
  }
}

std::vector<std::uint8_t> InputFile::read(std::uint64_t offset, std::size_t bytes) const {
  std::vector<std::uint8_t> content(bytes);
  read(offset, content);
  return content;
}

}  // namespace stillmap::dds
