#pragma once

#include <chrono>

namespace stillmap::dds {

/// Quality of service of a reader or writer, as far as Stillmap needs it.
struct TopicQos {
  bool reliable = true;
  /// Of a reliable reader: from writers that offer less than it asks for it reads by best effort,
  /// and what they write from then on (ROS 2's "best available").
  bool accept_best_effort = false;
  /// A late joiner gets the samples that the writer still has.
  bool transient_local = false;
  /// Samples kept, per key on a keyed topic.
  int depth = 10;
  /// Keep every sample, up to `depth` of them: a full writer waits, a full reliable reader makes
  /// the writer wait.
  bool keep_all = false;
  /// Keys a keyed topic may have.
  int max_keys = 1;
  /// Large samples: they keep to DdsOptions::large_message_bytes_per_s, and a write does not wait
  /// for that.
  bool large_messages = false;
  /// Longest wait of one write for room in a keep_all history.
  std::chrono::milliseconds max_blocking{100};
};

}  // namespace stillmap::dds
