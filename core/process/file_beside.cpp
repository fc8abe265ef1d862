#include "core/process/file_beside.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>

namespace stillmap {
namespace {

namespace fs = std::filesystem;

fs::path real_file(const fs::path& file) {
  std::error_code fault;
  fs::path real = fs::weakly_canonical(file, fault);
  return fault ? file : real;
}

/// Whether a file can be made there, for any reason but room, which the file itself lacks, too.
bool can_be_made(const fs::path& file) {
  const int made = ::open(file.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0666);
  if (made < 0) return errno == ENOSPC || errno == EDQUOT || errno == EIO;
  ::close(made);
  return true;
}

fs::path written_first(const fs::path& real) {
  std::error_code unknown;
  const fs::file_status there = fs::status(real, unknown);
  if (fs::exists(there) && !fs::is_regular_file(there)) return real;
  fs::path beside = real.string() + ".unfinished";
  return fs::exists(there) && !can_be_made(beside) ? real : beside;
}

}  // namespace

FileBeside::FileBeside(const fs::path& file)
    : file_(real_file(file)), written_(written_first(file_)) {}

FileBeside::~FileBeside() {
  std::error_code ignored;
  if (written_ != file_) fs::remove(written_, ignored);
}

std::error_code FileBeside::put_in_place() {
  std::error_code fault;
  if (written_ == file_) return fault;
  fs::rename(written_, file_, fault);
  std::error_code unknown;
  if (fault && fs::exists(file_, unknown)) {
    // A file whose place is somebody else's, as one that a container has mounted, gets the content.
    fault.clear();
    fs::copy_file(written_, file_, fs::copy_options::overwrite_existing, fault);
  } else if (!fault) {
    written_ = file_;
  }
  return fault;
}

}  // namespace stillmap
