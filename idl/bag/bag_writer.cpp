#include "idl/bag/bag_writer.hpp"

#include <SQLiteCpp/SQLiteCpp.h>

#include <algorithm>
#include <cassert>
#include <optional>

#include "core/dataset/dataset_error.hpp"
#include "idl/bag/mcap_writer.hpp"

namespace stillmap::dds {
namespace {

namespace fs = std::filesystem;

/// The tables of rosbag2's SQLite storage, schema 3.
constexpr const char* tables =
    "CREATE TABLE schema(schema_version INTEGER PRIMARY KEY,ros_distro TEXT NOT NULL);"
    "CREATE TABLE metadata(id INTEGER PRIMARY KEY,metadata_version INTEGER NOT NULL,metadata TEXT "
    "NOT NULL);"
    "CREATE TABLE topics(id INTEGER PRIMARY KEY,name TEXT NOT NULL,type TEXT NOT "
    "NULL,serialization_format TEXT NOT NULL,offered_qos_profiles TEXT NOT NULL);"
    "CREATE TABLE messages(id INTEGER PRIMARY KEY,topic_id INTEGER NOT NULL,timestamp INTEGER NOT "
    "NULL, data BLOB NOT NULL);"
    "CREATE INDEX timestamp_idx ON messages (timestamp ASC);"
    "INSERT INTO schema VALUES (3, 'humble');";

template <typename Action>
void writing(const fs::path& file, Action action) {
  try {
    action();
  } catch (const SQLite::Exception& fault) {
    throw DatasetWriteError(file, std::string("cannot be written: ") + fault.what() +
                                      "; what was committed before is kept");
  }
}

fs::path new_folder(const fs::path& folder) {
  std::error_code error;
  if (fs::exists(folder, error)) {
    throw DatasetError(folder, "is there already; name a new folder for the bag");
  }
  fs::create_directories(folder, error);
  if (error) throw DatasetError(folder, "cannot be made: " + error.message());
  return folder;
}

/// "out/" has the name "out".
std::string bag_name(const fs::path& folder) {
  const fs::path plain = folder.has_filename() ? folder : folder.parent_path();
  return fs::absolute(plain).lexically_normal().filename().string();
}

class SqliteStorage final : public BagStorage {
 public:
  SqliteStorage(const fs::path& file, const std::vector<BagTopic>& topics) : file_(file) {
    writing(file_, [&] {
      database_.emplace(file.string(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
      // A reader may look in meanwhile, and a commit costs one write.
      database_->exec("PRAGMA journal_mode=WAL; PRAGMA synchronous=NORMAL;");
      database_->exec(tables);
      add_topics(topics);
      insert_.emplace(*database_,
                      "INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)");
    });
  }

  void add(std::size_t topic, std::int64_t received_ns,
           std::span<const std::uint8_t> message) override {
    writing(file_, [&] {
      if (!transaction_) transaction_.emplace(*database_);
      insert_->bind(1, static_cast<std::int64_t>(topic + 1));
      insert_->bind(2, received_ns);
      // SQLite takes no address for NULL, which is no message.
      const void* begin = message.empty() ? "" : static_cast<const void*>(message.data());
      insert_->bindNoCopy(3, begin, static_cast<int>(message.size()));
      insert_->exec();
      insert_->reset();
    });
  }

  void commit() override {
    if (!transaction_) return;
    writing(file_, [&] { transaction_->commit(); });
    transaction_.reset();
  }

  void finish() override {
    commit();
    writing(file_, [&] {
      insert_.reset();
      // The log becomes part of the file, which anything may then read, from anywhere.
      database_->exec("PRAGMA journal_mode=DELETE");
    });
  }

 private:
  void add_topics(const std::vector<BagTopic>& topics) {
    SQLite::Statement insert(*database_, "INSERT INTO topics VALUES (?, ?, ?, ?, ?)");
    for (std::size_t i = 0; i < topics.size(); ++i) {
      insert.bind(1, static_cast<std::int64_t>(i + 1));
      insert.bind(2, topics[i].name);
      insert.bind(3, topics[i].type);
      insert.bind(4, topics[i].serialization_format);
      insert.bind(5, topics[i].offered_qos_profiles);
      insert.exec();
      insert.reset();
    }
  }

  fs::path file_;
  std::optional<SQLite::Database> database_;
  std::optional<SQLite::Statement> insert_;
  std::optional<SQLite::Transaction> transaction_;
};

}  // namespace

BagWriter::BagWriter(const fs::path& folder, const std::vector<BagTopic>& topics, BagFormat format,
                     mcap::Compression compression)
    : folder_(new_folder(folder)) {
  const bool is_mcap = format == BagFormat::mcap;
  const fs::path file = folder / (bag_name(folder) + (is_mcap ? "_0.mcap" : "_0.db3"));
  metadata_.storage = is_mcap ? "mcap" : "sqlite3";
  metadata_.files = {file.filename().string()};
  metadata_.topics = topics;
  if (is_mcap) {
    storage_ = std::make_unique<McapWriter>(file, topics, compression);
  } else {
    storage_ = std::make_unique<SqliteStorage>(file, topics);
  }
  write_bag_metadata(folder_ / "metadata.yaml", metadata_);
}

BagWriter::~BagWriter() {
  try {
    finish();
  } catch (const DatasetError&) {
    // finish() reports such errors.
  }
}

void BagWriter::add(std::size_t topic, std::int64_t received_ns,
                    std::span<const std::uint8_t> message) {
  assert(storage_ && topic < metadata_.topics.size());
  storage_->add(topic, received_ns, message);
  const std::int64_t end_ns = metadata_.start_ns + metadata_.duration_ns;
  if (messages_ == 0) {
    metadata_.start_ns = received_ns;
  } else {
    metadata_.start_ns = std::min(metadata_.start_ns, received_ns);
    metadata_.duration_ns = std::max(end_ns, received_ns) - metadata_.start_ns;
  }
  ++messages_;
  ++metadata_.topics[topic].messages;
  bytes_ += message.size();
}

void BagWriter::commit() {
  if (!storage_ || messages_ == committed_) return;
  storage_->commit();
  committed_ = messages_;
  write_bag_metadata(folder_ / "metadata.yaml", metadata_);
}

void BagWriter::finish() {
  if (!storage_) return;
  commit();
  storage_->finish();
  storage_.reset();
}

std::string offered_qos_yaml(bool reliable, bool transient_local, int depth) {
  const std::string forever = "\n    sec: 9223372036\n    nsec: 854775807";
  return "- history: 1\n  depth: " + std::to_string(depth) +
         "\n  reliability: " + (reliable ? "1" : "2") +
         "\n  durability: " + (transient_local ? "1" : "2") + "\n  deadline:" + forever +
         "\n  lifespan:" + forever + "\n  liveliness: 1\n  liveliness_lease_duration:" + forever +
         "\n  avoid_ros_namespace_conventions: false";
}

}  // namespace stillmap::dds
