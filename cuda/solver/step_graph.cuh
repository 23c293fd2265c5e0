/// A graph of several steps, recorded once and then launched at the cost of one launch.
#pragma once

#include "solver/device_model.cuh"

namespace phyxel::cuda {

class StepGraph {
 public:
  StepGraph() = default;
  StepGraph(const StepGraph&) = delete;
  StepGraph& operator=(const StepGraph&) = delete;
  ~StepGraph() { forget(); }

  /// Launches the kernels that `steps` launches on the stream, and records them first if necessary.
  template <class Steps>
  void launch(cudaStream_t stream, Steps&& steps) {
    if (!graph_) record(stream, steps);
    PHYXEL_CUDA(cudaGraphLaunch(graph_, stream));
  }
  /// Discards the recording. Call before any argument of the launches changes.
  void forget() {
    if (graph_) cudaGraphExecDestroy(std::exchange(graph_, nullptr));
  }

 private:
  template <class Steps>
  void record(cudaStream_t stream, Steps&& steps) {
    PHYXEL_CUDA(cudaStreamBeginCapture(stream, cudaStreamCaptureModeThreadLocal));
    cudaGraph_t recorded = nullptr;
    try {
      steps();
    } catch (...) {
      cudaStreamEndCapture(stream, &recorded);
      cudaGetLastError();  // clears the error, which an exception reports
      if (recorded) cudaGraphDestroy(recorded);
      throw;
    }
    PHYXEL_CUDA(cudaStreamEndCapture(stream, &recorded));
    const cudaError_t error = cudaGraphInstantiate(&graph_, recorded, 0);
    cudaGraphDestroy(recorded);
    check_cuda(error, "cudaGraphInstantiate");
  }

  cudaGraphExec_t graph_ = nullptr;
};

}  // namespace phyxel::cuda
