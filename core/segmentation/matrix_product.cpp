#include "core/segmentation/matrix_product.hpp"

#include <dnnl.h>

#include "core/segmentation/onednn/openmp_threads.hpp"

namespace stillmap {
namespace {

constexpr dnnl_dim_t size = 1536;
constexpr std::size_t values = static_cast<std::size_t>(size) * static_cast<std::size_t>(size);

}  // namespace

MatrixProduct::MatrixProduct(Precision precision, int threads)
    : precision_(precision), threads_(threads > 0 ? threads : omp_get_max_threads()) {
  if (precision == Precision::fp32) {
    left_.assign(values, 0.5F);
    right_.assign(values, 0.25F);
    product_.assign(values, 0.0F);
  } else {
    left_u8_.assign(values, 3);
    right_s8_.assign(values, 2);
    product_s32_.assign(values, 0);
  }
}

void MatrixProduct::run() {
  const OpenMpThreads set(threads_);
  if (precision_ == Precision::fp32) {
    dnnl_sgemm('N', 'N', size, size, size, 1.0F, left_.data(), size, right_.data(), size, 0.0F,
               product_.data(), size);
  } else {
    const std::int32_t offset = 0;
    dnnl_gemm_u8s8s32('N', 'N', 'F', size, size, size, 1.0F, left_u8_.data(), size, 0,
                      right_s8_.data(), size, 0, 0.0F, product_s32_.data(), size, &offset);
  }
}

double MatrixProduct::giga_operations() {
  return 2.0 * static_cast<double>(size) * static_cast<double>(values) / 1e9;
}

}  // namespace stillmap
