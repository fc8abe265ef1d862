#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "idl/dds/dds_error.hpp"
#include "idl/dds/dds_options.hpp"
#include "idl/dds/remote_participant.hpp"
#include "idl/dds/service_faults.hpp"
#include "idl/dds/topic_qos.hpp"

// Fast DDS's headers take two seconds to compile.
namespace eprosima::fastdds::dds {
class ContentFilteredTopic;
class DataReader;
class DataReaderListener;
class DataWriter;
class DataWriterListener;
class DomainParticipant;
class DomainParticipantFactory;
class DomainParticipantQos;
class Publisher;
class Subscriber;
class Topic;
class TypeSupport;
}  // namespace eprosima::fastdds::dds

namespace stillmap::dds {

class DiscoveryMonitor;
class RosGraph;
class RosNodes;
struct Identity;

/// Which samples a reader wants, as DDS writes it: a condition in SQL's manner on the fields of the
/// topic's type, and the values of its parameters %0, %1 and so on. The type must be described
/// (type_support.hpp).
struct ContentFilter {
  std::string expression;
  std::vector<std::string> parameters;
};

/// This process in a DDS domain; makes its readers and writers. ROS 2 tools show it as a node when
/// it has a node name. Endpoints must not outlive it. Thread-safe.
class Participant {
 public:
  /// Joins the domain. Throws DdsError; nothing is left behind then.
  explicit Participant(const DdsOptions& options);
  ~Participant();
  Participant(const Participant&) = delete;
  Participant& operator=(const Participant&) = delete;

  [[nodiscard]] const DdsOptions& options() const { return options_; }

  /// Peers of the options that no address is known for, and that are not looked for therefore.
  [[nodiscard]] const std::vector<std::string>& unresolved_peers() const {
    return unresolved_peers_;
  }

  /// What went wrong in the services that this process offers.
  [[nodiscard]] ServiceFaults& service_faults() { return service_faults_; }
  [[nodiscard]] const ServiceFaults& service_faults() const { return service_faults_; }

  /// The other participants of the domain, as discovery knows them now. Discovery takes a few
  /// seconds. With a node name, also which ROS 2 nodes they hold.
  [[nodiscard]] std::vector<RemoteParticipant> remote_participants() const;
  /// This participant, in the same terms.
  [[nodiscard]] RemoteParticipant self() const;

  /// Endpoints that leave the domain with their owner.
  using WriterHandle = std::unique_ptr<eprosima::fastdds::dds::DataWriter,
                                       std::function<void(eprosima::fastdds::dds::DataWriter*)>>;
  using ReaderHandle = std::unique_ptr<eprosima::fastdds::dds::DataReader,
                                       std::function<void(eprosima::fastdds::dds::DataReader*)>>;

  /// `topic` is the DDS name ("rt/points"). Throws DdsError naming topic and type; NotPermitted
  /// where our identity's permissions forbid it.
  [[nodiscard]] WriterHandle make_writer(const std::string& topic,
                                         eprosima::fastdds::dds::TypeSupport type,
                                         const TopicQos& qos,
                                         eprosima::fastdds::dds::DataWriterListener* listener);
  [[nodiscard]] ReaderHandle make_reader(const std::string& topic,
                                         eprosima::fastdds::dds::TypeSupport type,
                                         const TopicQos& qos,
                                         eprosima::fastdds::dds::DataReaderListener* listener);
  /// Gets only the samples that pass the filter, and no notice of disposed keys. Throws
  /// DdsError for a filter that does not fit the type.
  [[nodiscard]] ReaderHandle make_reader(const std::string& topic,
                                         eprosima::fastdds::dds::TypeSupport type,
                                         const TopicQos& qos, const ContentFilter& filter,
                                         eprosima::fastdds::dds::DataReaderListener* listener);

 private:
  using Handle = std::unique_ptr<eprosima::fastdds::dds::DomainParticipant,
                                 std::function<void(eprosima::fastdds::dds::DomainParticipant*)>>;

  [[nodiscard]] Handle join();
  [[nodiscard]] eprosima::fastdds::dds::Topic* topic(const std::string& name,
                                                     eprosima::fastdds::dds::TypeSupport type);
  [[nodiscard]] ReaderHandle own(eprosima::fastdds::dds::DataReader& reader,
                                 eprosima::fastdds::dds::ContentFilteredTopic* filtered);
  [[nodiscard]] DdsError failure(const std::string& what) const;
  void require_permission(const std::string& topic, bool to_write) const;
  [[nodiscard]] eprosima::fastdds::dds::DomainParticipantQos qos();

  DdsOptions options_;
  std::vector<std::string> unresolved_peers_;
  ServiceFaults service_faults_;
  std::mutex mutex_;
  // Who we are in a secured domain; nothing without security.
  std::unique_ptr<const Identity> identity_;
  // Hears from the participant until that is gone.
  std::unique_ptr<DiscoveryMonitor> monitor_;
  // Held so that the factory outlives this participant even in a process that is ending.
  std::shared_ptr<eprosima::fastdds::dds::DomainParticipantFactory> factory_;
  Handle handle_;
  eprosima::fastdds::dds::Publisher* publisher_ = nullptr;
  eprosima::fastdds::dds::Subscriber* subscriber_ = nullptr;
  std::map<std::string, eprosima::fastdds::dds::Topic*> topics_;
  std::uint64_t filters_made_ = 0;
  std::unique_ptr<RosGraph> graph_;
  std::unique_ptr<RosNodes> nodes_;
};

}  // namespace stillmap::dds
