#include "idl/bag/bag.hpp"

#include <SQLiteCpp/SQLiteCpp.h>

#include <algorithm>
#include <array>
#include <fstream>

#include "core/dataset/dataset_error.hpp"
#include "core/dataset/file_stamp.hpp"

namespace stillmap::dds {
namespace {

namespace fs = std::filesystem;

/// Runs `action`; an error of SQLite becomes one with the file's name.
template <typename Action>
auto reading(const fs::path& file, Action action) {
  try {
    return action();
  } catch (const SQLite::Exception& fault) {
    throw DatasetError(file, std::string("cannot be read as a rosbag2 in SQLite: ") + fault.what());
  }
}

/// A bag whose recorder was killed has a write-ahead log, which SQLite reads where it may write
/// beside the file. On a read-only medium, a file without log is opened as it is.
std::unique_ptr<SQLite::Database> open(const fs::path& file) {
  try {
    auto database = std::make_unique<SQLite::Database>(file.string(), SQLite::OPEN_READONLY);
    (void)database->tableExists("messages");
    return database;
  } catch (const SQLite::Exception&) {
    fs::path log = file;
    log += "-wal";
    std::error_code error;
    if (const auto size = fs::file_size(log, error); !error && size > 0) {
      throw DatasetError(file, "has a write-ahead log (" + log.filename().string() +
                                   ") and lies where nothing may be written: copy both to a "
                                   "folder of yours");
    }
  }
  const std::string uri = "file:" + file.string() + "?immutable=1";
  return std::make_unique<SQLite::Database>(uri, SQLite::OPEN_READONLY | SQLite::OPEN_URI);
}

bool has_column(SQLite::Database& database, const std::string& table, const std::string& column) {
  SQLite::Statement query(database, "SELECT count(*) FROM pragma_table_info(?) WHERE name = ?");
  query.bind(1, table);
  query.bind(2, column);
  return query.executeStep() && query.getColumn(0).getInt() > 0;
}

/// Files of a folder with this ending, "_2" before "_10".
std::vector<fs::path> files_with(const fs::path& folder, std::string_view ending) {
  std::vector<fs::path> files;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    if (entry.path().string().ends_with(ending)) files.push_back(entry.path());
  }
  std::ranges::sort(files, [](const fs::path& a, const fs::path& b) {
    return natural_less(a.filename().string(), b.filename().string());
  });
  return files;
}

[[noreturn]] void refuse_mcap(const fs::path& file) {
  throw DatasetError(file, "is MCAP, which is not read here: " + conversion_hint());
}

[[noreturn]] void refuse_ros_1(const fs::path& file) {
  throw DatasetError(file,
                     "is a bag of ROS 1, which is not read here: 'rosbags-convert --src BAG "
                     "--dst NEW_BAG' (Python package rosbags) makes one of ROS 2");
}

/// The files of a folder without metadata.
std::vector<fs::path> bag_files_in(const fs::path& folder) {
  for (const char* ending : {".db3", ".db3.zstd"}) {
    if (auto files = files_with(folder, ending); !files.empty()) return files;
  }
  if (const auto files = files_with(folder, ".mcap"); !files.empty()) refuse_mcap(files.front());
  throw DatasetError(folder, "holds no .db3 file of a bag");
}

/// Other recordings may have a metadata.yaml of their own.
bool describes_a_bag(const fs::path& metadata) {
  std::ifstream in(metadata);
  std::string word;
  return in >> word && word.starts_with("rosbag2_bagfile_information");
}

}  // namespace

BagFile::BagFile(const fs::path& file) : path_(file) {
  std::error_code error;
  if (!fs::is_regular_file(file, error)) throw DatasetError(file, "no such file; check the path");
  reading(file, [&] {
    database_ = open(file);
    for (const char* table : {"topics", "messages"}) {
      if (!database_->tableExists(table)) {
        throw DatasetError(file, std::string("is no rosbag2: it has no table '") + table + "'");
      }
    }
  });
}
BagFile::~BagFile() = default;
BagFile::BagFile(BagFile&&) noexcept = default;
BagFile& BagFile::operator=(BagFile&&) noexcept = default;

std::vector<BagTopic> BagFile::topics() const {
  return reading(path_, [&] {
    // The first versions did not store it.
    const bool qos = has_column(*database_, "topics", "offered_qos_profiles");
    SQLite::Statement query(*database_,
                            std::string("SELECT name, type, serialization_format, ") +
                                (qos ? "offered_qos_profiles" : "''") +
                                ", (SELECT count(*) FROM messages WHERE topic_id = topics.id) FROM "
                                "topics ORDER BY id");
    std::vector<BagTopic> topics;
    while (query.executeStep()) {
      topics.push_back({.name = query.getColumn(0).getString(),
                        .type = query.getColumn(1).getString(),
                        .serialization_format = query.getColumn(2).getString(),
                        .offered_qos_profiles = query.getColumn(3).getString(),
                        .messages = static_cast<std::uint64_t>(query.getColumn(4).getInt64())});
    }
    return topics;
  });
}

std::vector<BagMessage> BagFile::messages(const std::string& topic, std::size_t file) const {
  return reading(path_, [&] {
    SQLite::Statement query(*database_,
                            "SELECT m.id, m.timestamp FROM messages m JOIN topics t ON m.topic_id "
                            "= t.id WHERE t.name = ? ORDER BY m.timestamp, m.id");
    query.bind(1, topic);
    std::vector<BagMessage> messages;
    while (query.executeStep()) {
      messages.push_back({.file = file,
                          .row = query.getColumn(0).getInt64(),
                          .received_ns = query.getColumn(1).getInt64()});
    }
    return messages;
  });
}

std::vector<std::uint8_t> BagFile::bytes(std::int64_t row) const {
  return blob("SELECT data FROM messages WHERE id = ?", row, 0);
}

std::vector<std::uint8_t> BagFile::first_bytes(std::int64_t row, int bytes) const {
  return blob("SELECT substr(data, 1, ?2) FROM messages WHERE id = ?1", row, bytes);
}

std::vector<std::uint8_t> BagFile::blob(const char* query_text, std::int64_t row, int bytes) const {
  return reading(path_, [&] {
    SQLite::Statement query(*database_, query_text);
    query.bind(1, row);
    if (bytes > 0) query.bind(2, bytes);
    if (!query.executeStep()) {
      throw DatasetError(path_, "message " + std::to_string(row) + " is gone");
    }
    const SQLite::Column data = query.getColumn(0);
    const auto* begin = static_cast<const std::uint8_t*>(data.getBlob());
    return std::vector<std::uint8_t>(begin, begin + data.getBytes());
  });
}

bool is_bag(const fs::path& path) {
  std::error_code error;
  if (fs::is_directory(path, error)) {
    if (describes_a_bag(path / "metadata.yaml")) return true;
    return std::ranges::any_of(std::array{".db3", ".db3.zstd", ".mcap"}, [&](const char* ending) {
      return !files_with(path, ending).empty();
    });
  }
  const std::string name = path.string();
  return name.ends_with(".db3") || name.ends_with(".db3.zstd") || name.ends_with(".mcap") ||
         name.ends_with(".bag");
}

Bag::Bag(const fs::path& path) {
  std::error_code error;
  if (!fs::exists(path, error)) throw DatasetError(path, "no such file or folder; check the path");
  if (fs::is_directory(path, error)) {
    open(files_of_folder(path));
  } else {
    if (path.extension() == ".mcap") refuse_mcap(path);
    if (path.extension() == ".bag") refuse_ros_1(path);
    const fs::path metadata = path.parent_path() / "metadata.yaml";
    if (describes_a_bag(metadata)) compression_ = read_bag_metadata(metadata).compression;
    open({path});
  }
}

std::vector<fs::path> Bag::files_of_folder(const fs::path& folder) {
  if (!describes_a_bag(folder / "metadata.yaml")) return bag_files_in(folder);
  const BagMetadata metadata = read_bag_metadata(folder / "metadata.yaml");
  compression_ = metadata.compression;
  std::vector<fs::path> files;
  files.reserve(metadata.files.size());
  for (const std::string& file : metadata.files) files.push_back(folder / file);
  return files;
}

void Bag::open(const std::vector<fs::path>& files) {
  for (const fs::path& file : files) {
    fs::path to_open = file;
    // The recorder packs a file once it is full: the last one may still be as it is.
    if (file.extension() == ".zstd") {
      if (!decompressed_) decompressed_ = std::make_unique<TemporaryFolder>();
      to_open = decompressed_->path() / file.stem();
      decompress_file(file, to_open);
    }
    files_.emplace_back(to_open);
    names_.push_back(file);
    add_topics(files_.back());
  }
}

void Bag::add_topics(const BagFile& file) {
  for (BagTopic& topic : file.topics()) {
    const auto known = std::ranges::find(topics_, topic.name, &BagTopic::name);
    if (known == topics_.end()) {
      topics_.push_back(std::move(topic));
    } else {
      known->messages += topic.messages;
    }
  }
}

std::vector<BagMessage> Bag::messages(const std::string& topic) const {
  std::vector<BagMessage> messages;
  for (std::size_t file = 0; file < files_.size(); ++file) {
    const auto of_file = files_[file].messages(topic, file);
    messages.insert(messages.end(), of_file.begin(), of_file.end());
  }
  std::ranges::stable_sort(messages, {}, &BagMessage::received_ns);
  return messages;
}

std::vector<std::uint8_t> Bag::bytes(const BagMessage& message) const {
  std::vector<std::uint8_t> stored = files_.at(message.file).bytes(message.row);
  return compression_ == BagCompression::of_messages ? decompressed(stored) : stored;
}

std::vector<std::uint8_t> Bag::first_bytes(const BagMessage& message, int bytes) const {
  if (compression_ == BagCompression::of_messages) return this->bytes(message);
  return files_.at(message.file).first_bytes(message.row, bytes);
}

}  // namespace stillmap::dds
