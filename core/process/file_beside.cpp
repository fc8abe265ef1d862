#include "core/process/file_beside.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <string>

namespace stillmap {
namespace {

namespace fs = std::filesystem;

fs::path real_file(const fs::path& file) {
  std::error_code fault;
  fs::path real = fs::weakly_canonical(file, fault);
  return fault ? file : real;
}

/// Whether a file of one's own is or can be made there. Room may lack: the file itself lacks it,
/// too.
bool can_be_made(const fs::path& file) {
  constexpr int how = O_WRONLY | O_CREAT | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK;
  // What is made here is one's own, whatever owner the file system tells.
  int made = ::open(file.c_str(), how | O_EXCL, 0666);
  const bool is_new = made >= 0;
  if (!is_new && errno == EEXIST) made = ::open(file.c_str(), how, 0666);
  if (made < 0) return errno == ENOSPC || errno == EDQUOT || errno == EIO;
  struct stat known {};
  const bool is_own = is_new || (::fstat(made, &known) == 0 && S_ISREG(known.st_mode) &&
                                 known.st_uid == ::geteuid());
  ::close(made);
  return is_own;
}

fs::path written_first(const fs::path& real) {
  std::error_code unknown;
  const fs::file_status there = fs::status(real, unknown);
  if (fs::exists(there) && !fs::is_regular_file(there)) return real;
  // What a killed process has left is written over by the next: its name is known.
  const fs::path beside = real.string() + ".unfinished";
  if (can_be_made(beside)) return beside;
  // In a folder for everybody another user may have left one.
  fs::path beside_of_user = beside.string() + "-" + std::to_string(::geteuid());
  if (can_be_made(beside_of_user)) return beside_of_user;
  return fs::exists(there) ? real : beside;
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
  std::error_code ignored;
  const fs::file_status before = fs::status(file_, ignored);
  if (fs::is_regular_file(before)) fs::permissions(written_, before.permissions(), ignored);
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
