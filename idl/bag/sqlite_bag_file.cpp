#include <SQLiteCpp/SQLiteCpp.h>
#include <sqlite3.h>

#include <algorithm>
#include <memory>
#include <set>
#include <utility>

#include "core/dataset/dataset_error.hpp"
#include "idl/bag/bag_file.hpp"

namespace stillmap::dds {
namespace {

namespace fs = std::filesystem;

/// Of the file, or of the disk beneath it.
bool is_damage(const SQLite::Exception& fault) {
  return fault.getErrorCode() == SQLITE_CORRUPT || fault.getErrorCode() == SQLITE_IOERR;
}

/// Runs `action`; an error of SQLite becomes one with the file's name.
template <typename Action>
auto reading(const fs::path& file, Action action) {
  try {
    return action();
  } catch (const SQLite::Exception& fault) {
    std::string text = std::string("cannot be read as a rosbag2 in SQLite: ") + fault.what();
    if (is_damage(fault)) {
      text += "; 'sqlite3 " + file.filename().string() +
              " .recover | sqlite3 recovered.db3' saves what is left in it";
    }
    throw DatasetError(file, text);
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
  auto database = std::make_unique<SQLite::Database>(uri, SQLite::OPEN_READONLY | SQLite::OPEN_URI);
  try {
    (void)database->tableExists("messages");
  } catch (const SQLite::Exception& fault) {
    // Where the end of the file is missing, SQLite reads what is there only when it is told that
    // somebody is repairing it.
    if (fault.getErrorCode() == SQLITE_CORRUPT) database->exec("PRAGMA writable_schema = ON");
  }
  return database;
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
    count_messages();
  });
}

void SqliteBagFile::count_messages() {
  try {
    SQLite::Statement query(*database_,
                            "SELECT topic_id, count(*) FROM messages GROUP BY topic_id");
    while (query.executeStep()) {
      messages_of_topic_[query.getColumn(0).getInt64()] =
          static_cast<std::uint64_t>(query.getColumn(1).getInt64());
    }
  } catch (const SQLite::Exception& fault) {
    if (!is_damage(fault)) throw;
    find_readable_rows();
    faults_.push_back(
        std::string("is damaged (") + fault.what() + "): " + std::to_string(readable_->size()) +
        " messages before and behind the damage are read; 'sqlite3 " + path_.filename().string() +
        " .recover | sqlite3 recovered.db3' may save more");
  }
}

std::vector<SqliteBagFile::Row> SqliteBagFile::rows_until_damage(bool backwards,
                                                                 std::int64_t end) const {
  std::vector<Row> rows;
  try {
    // By their numbers, as the messages lie in the file; an index may be damaged, too.
    SQLite::Statement query(*database_,
                            std::string("SELECT id, topic_id, timestamp FROM messages NOT INDEXED "
                                        "ORDER BY id ") +
                                (backwards ? "DESC" : "ASC"));
    while (query.executeStep()) {
      const std::int64_t number = query.getColumn(0).getInt64();
      const bool goes_on = rows.empty() || (rows.back().message.row < number) != backwards;
      if (number == end || !goes_on) break;
      rows.push_back({.message = {.file = 0,
                                  .row = number,
                                  .chunk = 0,
                                  .received_ns = query.getColumn(2).getInt64()},
                      .topic = query.getColumn(1).getInt64()});
    }
  } catch (const SQLite::Exception&) {
    // So far and no further.
  }
  return rows;
}

void SqliteBagFile::find_readable_rows() {
  constexpr std::int64_t none = -1;
  std::vector<Row> rows = rows_until_damage(false, none);
  const auto behind = rows_until_damage(true, rows.empty() ? none : rows.back().message.row);
  rows.insert(rows.end(), behind.rbegin(), behind.rend());
  messages_of_topic_.clear();
  for (const Row& row : rows) ++messages_of_topic_[row.topic];
  readable_ = std::move(rows);
}

SqliteBagFile::~SqliteBagFile() = default;

std::vector<BagTopic> SqliteBagFile::topics() const {
  return reading(path_, [&] {
    // The first versions did not store it.
    const bool qos = has_column(*database_, "topics", "offered_qos_profiles");
    SQLite::Statement query(*database_, std::string("SELECT name, type, serialization_format, ") +
                                            (qos ? "offered_qos_profiles" : "''") +
                                            ", id FROM topics ORDER BY id");
    std::vector<BagTopic> topics;
    while (query.executeStep()) {
      const auto counted = messages_of_topic_.find(query.getColumn(4).getInt64());
      topics.push_back({.name = query.getColumn(0).getString(),
                        .type = query.getColumn(1).getString(),
                        .serialization_format = query.getColumn(2).getString(),
                        .offered_qos_profiles = query.getColumn(3).getString(),
                        .messages = counted == messages_of_topic_.end() ? 0 : counted->second});
    }
    return topics;
  });
}

std::vector<BagMessage> SqliteBagFile::messages(const std::string& topic, std::size_t file) const {
  if (readable_) return readable_messages(topic, file);
  return reading(path_, [&] {
    SQLite::Statement query(*database_,
                            "SELECT m.id, m.timestamp FROM messages m NOT INDEXED JOIN topics t ON "
                            "m.topic_id = t.id WHERE t.name = ? ORDER BY m.timestamp, m.id");
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

std::vector<BagMessage> SqliteBagFile::readable_messages(const std::string& topic,
                                                         std::size_t file) const {
  return reading(path_, [&] {
    SQLite::Statement query(*database_, "SELECT id FROM topics WHERE name = ?");
    query.bind(1, topic);
    std::set<std::int64_t> numbers;
    while (query.executeStep()) numbers.insert(query.getColumn(0).getInt64());
    std::vector<BagMessage> messages;
    for (const Row& row : *readable_) {
      if (!numbers.contains(row.topic)) continue;
      messages.push_back(row.message);
      messages.back().file = file;
    }
    std::ranges::stable_sort(messages, {}, &BagMessage::received_ns);
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
