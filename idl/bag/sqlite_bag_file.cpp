#include <SQLiteCpp/SQLiteCpp.h>
#include <sqlite3.h>

#include <algorithm>
#include <memory>

#include "core/dataset/dataset_error.hpp"
#include "idl/bag/bag_file.hpp"

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

}  // namespace

SqliteBagFile::SqliteBagFile(const fs::path& file) : path_(file) {
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
SqliteBagFile::~SqliteBagFile() = default;

std::vector<BagTopic> SqliteBagFile::topics() const {
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

std::vector<BagMessage> SqliteBagFile::messages(const std::string& topic, std::size_t file) const {
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

std::vector<std::uint8_t> SqliteBagFile::bytes(const BagMessage& message) const {
  return blob("SELECT data FROM messages WHERE id = ?", message.row, 0);
}

std::vector<std::uint8_t> SqliteBagFile::first_bytes(const BagMessage& message, int bytes) const {
  // A query would read the whole blob, and with all messages the whole bag.
  sqlite3_blob* opened = nullptr;
  if (sqlite3_blob_open(database_->getHandle(), "main", "messages", "data", message.row, 0,
                        &opened) == SQLITE_OK) {
    const std::unique_ptr<sqlite3_blob, decltype(&sqlite3_blob_close)> closing(opened,
                                                                               &sqlite3_blob_close);
    std::vector<std::uint8_t> first(
        static_cast<std::size_t>(std::min(bytes, sqlite3_blob_bytes(opened))));
    if (sqlite3_blob_read(opened, first.data(), static_cast<int>(first.size()), 0) == SQLITE_OK)
      return first;
  }
  // Where the table is another recorder's, or the page is damaged.
  return blob("SELECT substr(data, 1, ?2) FROM messages WHERE id = ?1", message.row, bytes);
}

std::vector<std::uint8_t> SqliteBagFile::blob(const char* query_text, std::int64_t row,
                                              int bytes) const {
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

}  // namespace stillmap::dds
