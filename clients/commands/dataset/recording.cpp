#include "clients/commands/dataset/recording.hpp"

#include <iostream>

#include "idl/bag/bag_scan_source.hpp"

namespace stillmap::cli {

ScanDataset open_recording(const std::string& path, const std::string& topic) {
  dds::Recording recording = dds::open_recording(path, topic);
  for (const std::string& fault : recording.faults) std::cerr << "stillmap: " << fault << "\n";
  return std::move(recording.dataset);
}

}  // namespace stillmap::cli
