#include "clients/gateway/static_files.hpp"

#include <xxhash.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>

namespace stillmap::gateway {
namespace {

namespace fs = std::filesystem;

std::string content_type(const fs::path& file) {
  constexpr std::array<std::pair<std::string_view, std::string_view>, 6> types{
      {{".html", "text/html; charset=utf-8"},
       {".js", "text/javascript; charset=utf-8"},
       {".css", "text/css; charset=utf-8"},
       {".svg", "image/svg+xml"},
       {".png", "image/png"},
       {".txt", "text/plain; charset=utf-8"}}};
  for (const auto& [ending, type] : types) {
    if (file.extension() == ending) return std::string(type);
  }
  return "application/octet-stream";
}

std::string read(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// As the bundler names files: main-4XQ7ABCD.js.
bool has_hash_in_name(const fs::path& file) {
  constexpr std::size_t hash_characters = 8;
  const std::string stem = file.stem().string();
  if (!file.has_extension() || stem.size() <= hash_characters) return false;
  const std::string_view end = std::string_view(stem).substr(stem.size() - hash_characters - 1);
  return end.front() == '-' && std::ranges::all_of(end.substr(1), [](char c) {
           return (c >= '0' && c <= '9') || (c >= 'A' && c <= 'Z');
         });
}

}  // namespace

StaticFiles::StaticFiles(const fs::path& folder) {
  std::error_code none;
  for (const auto& entry : fs::recursive_directory_iterator(folder, none)) {
    if (!entry.is_regular_file()) continue;
    StaticFile file{.body = read(entry.path()),
                    .content_type = content_type(entry.path()),
                    .etag = {},
                    .is_immutable = has_hash_in_name(entry.path())};
    const auto hash = XXH3_64bits(file.body.data(), file.body.size());
    file.etag = "\"" + std::to_string(hash) + "\"";
    files_.emplace("/" + entry.path().lexically_relative(folder).generic_string(), std::move(file));
  }
  if (files_.contains("/index.html")) return;
  throw std::invalid_argument("folder '" + folder.string() +
                              "' has no index.html: 'make web' builds the page into "
                              "build/release/share/stillmap/web; or give --no-page");
}

const StaticFile* StaticFiles::find(std::string_view path) const {
  const auto found = files_.find(path == "/" ? std::string_view("/index.html") : path);
  return found == files_.end() ? nullptr : &found->second;
}

}  // namespace stillmap::gateway
