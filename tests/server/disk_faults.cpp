// Preloaded into a server (LD_PRELOAD), makes its disk fail: as long as the file $STILLMAP_FAULT
// holds "full", "read_only" or "fsync", calls fail on files in $STILLMAP_FAULT_FOLDER; with
// "half_reset", no file there can be given the name city.stillmap; with "unreadable", what has that
// name cannot be read.

#include <dlfcn.h>
#include <fcntl.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <cstdarg>
#include <cstdlib>
#include <string>
#include <string_view>

namespace {

template <typename Function>
Function* next(const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

int open_file(const char* file, int flags, mode_t mode) {
  static auto* const real = next<int(const char*, int, ...)>("open64");
  return real(file, flags, mode);
}

ssize_t write_at(int descriptor, const void* bytes, size_t count, off64_t offset) {
  static auto* const real = next<ssize_t(int, const void*, size_t, off64_t)>("pwrite64");
  return real(descriptor, bytes, count, offset);
}

bool is_watched(std::string_view path) {
  const char* const folder = std::getenv("STILLMAP_FAULT_FOLDER");
  return folder != nullptr && path.starts_with(folder);
}

std::string name_of(int descriptor) {
  std::array<char, 4096> path{};
  const std::string link = "/proc/self/fd/" + std::to_string(descriptor);
  const ssize_t length = readlink(link.c_str(), path.data(), path.size());
  return {path.data(), static_cast<size_t>(length > 0 ? length : 0)};
}

bool is_watched(int descriptor) { return is_watched(name_of(descriptor)); }

bool is_city(std::string_view path) { return is_watched(path) && path.ends_with("/city.stillmap"); }

std::string fault() {
  const char* const control = std::getenv("STILLMAP_FAULT");
  const int descriptor = control == nullptr ? -1 : open_file(control, O_RDONLY, 0);
  if (descriptor < 0) return {};
  std::array<char, 16> text{};
  const ssize_t length = read(descriptor, text.data(), text.size());
  close(descriptor);
  return {text.data(), static_cast<size_t>(length > 0 ? length : 0)};
}

/// The error that a write to it fails with; 0: none.
int write_error(int descriptor) {
  if (!is_watched(descriptor)) return 0;
  const std::string now = fault();
  return now == "full" ? ENOSPC : now == "read_only" ? EROFS : 0;
}

bool is_read_only(const char* path) { return is_watched(path) && fault() == "read_only"; }

int failing(int error) {
  errno = error;
  return -1;
}

}  // namespace

extern "C" {

ssize_t pread64(int descriptor, void* bytes, size_t count, off64_t offset) {
  static auto* const real = next<ssize_t(int, void*, size_t, off64_t)>("pread64");
  if (is_city(name_of(descriptor)) && fault() == "unreadable") return failing(EIO);
  return real(descriptor, bytes, count, offset);
}

ssize_t pwrite64(int descriptor, const void* bytes, size_t count, off64_t offset) {
  const int error = write_error(descriptor);
  if (error == 0) return write_at(descriptor, bytes, count, offset);
  // The last block that fits is written before a disk is full.
  static std::atomic<unsigned> calls = 0;
  if (error == ENOSPC && count > 1 && ++calls % 2 == 0) {
    return write_at(descriptor, bytes, count / 2, offset);
  }
  return failing(error);
}

ssize_t write(int descriptor, const void* bytes, size_t count) {
  static auto* const real = next<ssize_t(int, const void*, size_t)>("write");
  if (const int error = write_error(descriptor)) return failing(error);
  return real(descriptor, bytes, count);
}

int ftruncate64(int descriptor, off64_t length) {
  static auto* const real = next<int(int, off64_t)>("ftruncate64");
  if (const int error = write_error(descriptor)) return failing(error);
  return real(descriptor, length);
}

int fdatasync(int descriptor) {
  static auto* const real = next<int(int)>("fdatasync");
  if (is_watched(descriptor) && fault() == "fsync") return failing(EIO);
  return real(descriptor);
}

int fsync(int descriptor) {
  static auto* const real = next<int(int)>("fsync");
  if (is_watched(descriptor) && fault() == "fsync") return failing(EIO);
  return real(descriptor);
}

int open64(const char* path, int flags, ...) {
  mode_t mode = 0;
  if ((flags & O_CREAT) != 0) {
    va_list rest;
    va_start(rest, flags);
    mode = va_arg(rest, mode_t);
    va_end(rest);
  }
  if ((flags & (O_WRONLY | O_RDWR | O_CREAT)) != 0 && is_read_only(path)) return failing(EROFS);
  return open_file(path, flags, mode);
}

int rename(const char* from, const char* to) noexcept {
  static auto* const real = next<int(const char*, const char*)>("rename");
  if (is_read_only(from)) return failing(EROFS);
  if (is_city(to) && fault() == "half_reset") return failing(EROFS);
  return real(from, to);
}

int unlink(const char* path) noexcept {
  static auto* const real = next<int(const char*)>("unlink");
  if (is_read_only(path)) return failing(EROFS);
  return real(path);
}

}  // extern "C"
