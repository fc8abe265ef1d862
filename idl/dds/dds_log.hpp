#pragma once

namespace stillmap::dds {

/// Fast DDS writes its own log lines to stdout, into the middle of what a program prints for other
/// programs. From now on they go to stderr.
void log_dds_to_stderr();

}  // namespace stillmap::dds
