#include "core/occupancy/octomap_file.hpp"

#include <cassert>
#include <cmath>
#include <fstream>
#include <limits>
#include <sstream>
#include <system_error>

#include "core/occupancy/octomap_data.hpp"
#include "core/process/file_beside.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;

const char* first_line(OctomapEncoding encoding) {
  return encoding == OctomapEncoding::binary ? "# Octomap OcTree binary file"
                                             : "# Octomap OcTree file";
}

std::string header_of(const OctomapData& data, std::uint64_t nodes) {
  std::ostringstream header;
  header.precision(std::numeric_limits<double>::max_digits10);
  header << first_line(data.encoding) << "\n# (feel free to add / change comments, but leave the "
         << "first line as it is!)\n#\nid " << OctomapData::tree_id << "\nsize " << nodes
         << "\nres " << data.resolution_m << "\ndata\n";
  return header.str();
}

struct Header {
  std::string id;
  std::uint64_t nodes = 0;
  double resolution_m = 0.0;
};

/// Reads up to and including the line "data".
Header read_header(std::istream& in, const fs::path& file) {
  Header header;
  for (std::string line; std::getline(in, line);) {
    if (line.starts_with('#')) continue;
    if (line == "data") return header;
    std::istringstream words(line);
    std::string key;
    words >> key;
    if (key == "id") words >> header.id;
    if (key == "size") words >> header.nodes;
    if (key == "res") words >> header.resolution_m;
    if (!words) throw MapFileError(file, "has a damaged header line '" + line + "'");
  }
  throw MapFileError(file, "has no line 'data' after its header: the file is damaged");
}

std::string read_all(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::error_code error;
  if (!in || !fs::is_regular_file(file, error)) {
    throw MapFileError(file, "cannot be read; check the path and its permissions");
  }
  return {std::istreambuf_iterator<char>(in), {}};
}

}  // namespace

OctomapEncoding octomap_encoding_of(const fs::path& file) {
  if (file.extension() == ".bt") return OctomapEncoding::binary;
  if (file.extension() == ".ot") return OctomapEncoding::full;
  throw MapFileError(file,
                     "the name must end in .bt (occupied and free only) or .ot (with "
                     "probabilities)");
}

void write_octomap_file(const fs::path& file, const OctomapData& data) {
  assert(octomap_encoding_of(file) == data.encoding);
  FileBeside beside(file);
  std::ofstream out(beside.path(), std::ios::binary | std::ios::trunc);
  out << header_of(data, check_octomap(data).nodes) << data.bytes;
  out.close();
  if (out && !beside.put_in_place()) return;
  throw MapFileWriteError(file, "cannot be written; check the folder and the space left");
}

OctomapData read_octomap_file(const fs::path& file) {
  OctomapData data;
  data.encoding = octomap_encoding_of(file);
  std::istringstream in(read_all(file));
  std::string line;
  std::getline(in, line);
  if (line != first_line(data.encoding)) {
    throw MapFileError(file, std::string("does not begin with '") + first_line(data.encoding) +
                                 "': it is no such file, or damaged");
  }
  const Header header = read_header(in, file);
  if (header.id != OctomapData::tree_id) {
    throw MapFileError(file, "holds a tree of type '" + header.id + "'; only OcTree can be read");
  }
  if (!(header.resolution_m > 0.0) || !std::isfinite(header.resolution_m)) {
    throw MapFileError(file, "has no resolution above 0 in its header: the file is damaged");
  }
  data.resolution_m = header.resolution_m;
  data.bytes.assign(std::istreambuf_iterator<char>(in), {});
  const OctomapCheck check = check_octomap(data);
  if (!check.fault.empty()) throw MapFileError(file, "is damaged: " + check.fault);
  if (check.nodes != header.nodes) {
    throw MapFileError(file, "is damaged: its header promises " + std::to_string(header.nodes) +
                                 " nodes, it has " + std::to_string(check.nodes));
  }
  return data;
}

}  // namespace stillmap
