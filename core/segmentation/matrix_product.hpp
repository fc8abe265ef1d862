#pragma once

#include <cstdint>
#include <vector>

#include "core/segmentation/onednn_network.hpp"

namespace stillmap {

/// A product of two large square matrices on oneDNN: what the machine can do at its best, against
/// which networks are measured.
class MatrixProduct {
 public:
  /// In fp32, or u8 times s8 for int8, with so many threads; 0 leaves them to OpenMP.
  MatrixProduct(Precision precision, int threads);

  void run();
  /// Multiplications and additions of a run, in 10^9.
  [[nodiscard]] static double giga_operations();

 private:
  Precision precision_;
  int threads_;
  std::vector<float> left_, right_, product_;
  std::vector<std::uint8_t> left_u8_;
  std::vector<std::int8_t> right_s8_;
  std::vector<std::int32_t> product_s32_;
};

}  // namespace stillmap
