#pragma once

#include <sqlite3.h>

#include <chrono>
#include <thread>

namespace stillmap::test {

/// While it lives, the seconds for which SQLite waits for a lock of somebody else pass forty times
/// as fast, for files that are opened meanwhile and closed before its end: SQLite counts what it
/// slept, and sleeps less. For tests in which nobody gives the lock back.
class ShortLockPatience {
 public:
  ShortLockPatience() : vfs_(*::sqlite3_vfs_find(nullptr)) {
    vfs_.zName = "short_lock_patience";
    vfs_.xSleep = [](sqlite3_vfs*, int microseconds) {
      std::this_thread::sleep_for(std::chrono::microseconds(microseconds / 40));
      return microseconds;
    };
    ::sqlite3_vfs_register(&vfs_, 1);
  }
  ~ShortLockPatience() { ::sqlite3_vfs_unregister(&vfs_); }
  ShortLockPatience(const ShortLockPatience&) = delete;
  ShortLockPatience& operator=(const ShortLockPatience&) = delete;

 private:
  sqlite3_vfs vfs_;
};

}  // namespace stillmap::test
