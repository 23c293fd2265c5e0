/// Launches of several steps recorded once, and repeated at the cost of one launch.
#pragma once

#include "solver/device_model.cuh"

namespace phyxel::cuda {

class StepGraph {
 public:
  StepGraph() = default;
  StepGraph(const StepGraph&) = delete;
  StepGraph& operator=(const StepGraph&) = delete;
  ~StepGraph() { forget(); }

  /// Launches what `steps` launches on the stream; recorded if it is not yet.
  template <class Steps>
  void launch(cudaStream_t stream, Steps&& steps) {
    if (!graph_) record(stream, steps);
    PHYXEL_CUDA(cudaGraphLaunch(graph_, stream));
  }
  /// To be called before anything changes that the launches were told.
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
      cudaGetLastError();  // what went wrong is on its way
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
