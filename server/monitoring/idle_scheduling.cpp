#include "server/monitoring/idle_scheduling.hpp"

#include <sched.h>

namespace stillmap::server {

bool use_idle_scheduling() {
  // A nice value is not enough: the network's threads wait for each other many times a scan, and a
  // thread that holds one of them up for a moment holds up both.
  const sched_param none{};
  return sched_setscheduler(0, SCHED_IDLE, &none) == 0;
}

}  // namespace stillmap::server
