#include "core/planning/path_search.hpp"

#include <ompl/base/OptimizationObjective.h>
#include <ompl/base/goals/GoalStates.h>
#include <ompl/base/samplers/InformedStateSampler.h>
#include <ompl/base/spaces/ReedsSheppStateSpace.h>
#include <ompl/geometric/PathGeometric.h>
#include <ompl/geometric/planners/informedtrees/BITstar.h>
#include <ompl/geometric/planners/rrt/RRTConnect.h>
#include <ompl/geometric/planners/rrt/RRTstar.h>
#include <ompl/util/RandomNumbers.h>

#include <cmath>
#include <numbers>

namespace stillmap {
namespace {

namespace ob = ompl::base;
namespace og = ompl::geometric;
using PoseState = ob::SE2StateSpace::StateType;

PlanarPose pose_of(const ob::State* state) {
  const auto* pose = state->as<PoseState>();
  return {{pose->getX(), pose->getY()}, pose->getYaw()};
}

void set(ob::State* state, const PlanarPose& pose) {
  auto* target = state->as<PoseState>();
  target->setXY(pose.position_map.x(), pose.position_map.y());
  // OMPL's angles are in [-pi, pi).
  const double yaw_rad = std::remainder(pose.heading_rad, 2.0 * std::numbers::pi);
  target->setYaw(yaw_rad >= std::numbers::pi ? -std::numbers::pi : yaw_rad);
}

class FreePose final : public ob::StateValidityChecker {
 public:
  FreePose(const ob::SpaceInformationPtr& space, const PlanningGrid& grid)
      : StateValidityChecker(space), grid_(grid) {}
  bool isValid(const ob::State* state) const override { return grid_.is_free(pose_of(state)); }

 private:
  const PlanningGrid& grid_;
};

class FreeCurve final : public ob::MotionValidator {
 public:
  FreeCurve(const ob::SpaceInformationPtr& space, const CollisionChecker& checker)
      : MotionValidator(space), checker_(checker) {}
  bool checkMotion(const ob::State* a, const ob::State* b) const override {
    return std::isfinite(checker_.cost(pose_of(a), pose_of(b)));
  }
  bool checkMotion(const ob::State* a, const ob::State* b,
                   std::pair<ob::State*, double>& last_valid) const override {
    if (last_valid.first != nullptr) si_->copyState(last_valid.first, a);
    last_valid.second = 0.0;
    return checkMotion(a, b);
  }

 private:
  const CollisionChecker& checker_;
};

/// PoseSampler for planners that use a plain sampler.
class PlainSampler final : public ob::StateSampler {
 public:
  PlainSampler(const ob::StateSpace* space, PoseSampler& poses)
      : StateSampler(space), poses_(poses) {}
  void sampleUniform(ob::State* state) override {
    set(state, poses_.draw());
    space_->enforceBounds(state);
  }
  void sampleUniformNear(ob::State* state, const ob::State*, double) override {
    sampleUniform(state);
  }
  void sampleGaussian(ob::State* state, const ob::State*, double) override { sampleUniform(state); }

 private:
  PoseSampler& poses_;
};

/// PoseSampler for planners that use only samples that can improve the path.
class InformedPoses final : public ob::InformedSampler {
 public:
  InformedPoses(const ob::ProblemDefinitionPtr& problem, unsigned int tries, PoseSampler& poses)
      : InformedSampler(problem, tries), poses_(poses) {}
  bool sampleUniform(ob::State* state, const ob::Cost& max_cost) override {
    for (unsigned int i = 0; i < numIters_; ++i) {
      set(state, poses_.draw());
      if (!space_->satisfiesBounds(state)) continue;
      if (opt_->isCostBetterThan(heuristicSolnCost(state), max_cost)) return true;
    }
    return false;
  }
  bool sampleUniform(ob::State* state, const ob::Cost& min_cost,
                     const ob::Cost& max_cost) override {
    return sampleUniform(state, max_cost) &&
           !opt_->isCostBetterThan(heuristicSolnCost(state), min_cost);
  }
  bool hasInformedMeasure() const override { return false; }
  double getInformedMeasure(const ob::Cost&) const override { return space_->getMeasure(); }

 private:
  PoseSampler& poses_;
};

class CurveCost final : public ob::OptimizationObjective {
 public:
  CurveCost(const ob::SpaceInformationPtr& space, const CollisionChecker& checker,
            PoseSampler& poses, const Eigen::Vector2d& goal_map)
      : OptimizationObjective(space), checker_(checker), poses_(poses) {
    description_ = "cost of driving";
    // All goals share one position.
    setCostToGoHeuristic([goal_map](const ob::State* state, const ob::Goal*) {
      return ob::Cost((pose_of(state).position_map - goal_map).norm());
    });
  }
  ob::Cost stateCost(const ob::State*) const override { return identityCost(); }
  ob::Cost motionCost(const ob::State* a, const ob::State* b) const override {
    return ob::Cost(checker_.cost(pose_of(a), pose_of(b)));
  }
  ob::Cost motionCostHeuristic(const ob::State* a, const ob::State* b) const override {
    return ob::Cost(si_->distance(a, b));
  }
  bool isSymmetric() const override { return false; }
  ob::InformedSamplerPtr allocInformedStateSampler(const ob::ProblemDefinitionPtr& problem,
                                                   unsigned int tries) const override {
    return std::make_shared<InformedPoses>(problem, tries, poses_);
  }

 private:
  const CollisionChecker& checker_;
  PoseSampler& poses_;
};

ob::SpaceInformationPtr make_space(const CollisionChecker& checker, PoseSampler& sampler) {
  const PlanningGrid& grid = checker.grid();
  auto curves =
      std::make_shared<ob::ReedsSheppStateSpace>(curve_radius_m(grid.profile(), grid.cell_m()));
  ob::RealVectorBounds bounds(2);
  for (unsigned int axis = 0; axis < 2; ++axis) {
    bounds.setLow(axis, grid.bounds_map().min()[axis]);
    bounds.setHigh(axis, grid.bounds_map().max()[axis]);
  }
  curves->setBounds(bounds);
  curves->setStateSamplerAllocator([&sampler](const ob::StateSpace* space) {
    return std::make_shared<PlainSampler>(space, sampler);
  });
  auto space = std::make_shared<ob::SpaceInformation>(curves);
  space->setStateValidityChecker(std::make_shared<FreePose>(space, grid));
  space->setMotionValidator(std::make_shared<FreeCurve>(space, checker));
  space->setup();
  return space;
}

ob::ProblemDefinitionPtr make_problem(const ob::SpaceInformationPtr& space,
                                      const CollisionChecker& checker, PoseSampler& sampler,
                                      std::span<const PlanarPose> starts,
                                      std::span<const PlanarPose> goals) {
  auto problem = std::make_shared<ob::ProblemDefinition>(space);
  ob::ScopedState<> state(space);
  for (const PlanarPose& start : starts) {
    set(state.get(), start);
    problem->addStartState(state);
  }
  auto goal_states = std::make_shared<ob::GoalStates>(space);
  for (const PlanarPose& goal : goals) {
    set(state.get(), goal);
    goal_states->addState(state);
  }
  problem->setGoal(goal_states);
  problem->setOptimizationObjective(
      std::make_shared<CurveCost>(space, checker, sampler, goals.front().position_map));
  return problem;
}

ob::PlannerPtr make_planner(PlannerKind kind, const ob::SpaceInformationPtr& space) {
  // Longer curves are rarely free of collisions in streets.
  constexpr double max_step_m = 15.0;
  switch (kind) {
    case PlannerKind::rrt_star: {
      auto planner = std::make_shared<og::RRTstar>(space);
      planner->setRange(max_step_m);
      return planner;
    }
    case PlannerKind::rrt_connect: {
      auto planner = std::make_shared<og::RRTConnect>(space);
      planner->setRange(max_step_m);
      return planner;
    }
    case PlannerKind::bit_star:
      break;
  }
  auto planner = std::make_shared<og::BITstar>(space);
  planner->setConsiderApproximateSolutions(true);
  return planner;
}

void report_improvements(ob::ProblemDefinition& problem,
                         const std::function<void(double)>& improved) {
  if (!improved) return;
  problem.setIntermediateSolutionCallback(
      [improved](const ob::Planner*, const std::vector<const ob::State*>&, const ob::Cost cost) {
        improved(cost.value());
      });
}

}  // namespace

SearchResult search_path(const CollisionChecker& checker, PoseSampler& sampler,
                         std::span<const PlanarPose> starts, std::span<const PlanarPose> goals,
                         const PlanningConfig& config) {
  ompl::msg::noOutputHandler();
  ompl::RNG::setSeed(config.seed);
  const ob::SpaceInformationPtr space = make_space(checker, sampler);
  const ob::ProblemDefinitionPtr problem = make_problem(space, checker, sampler, starts, goals);
  report_improvements(*problem, config.improved);
  const ob::PlannerPtr planner = make_planner(config.planner, space);
  planner->setProblemDefinition(problem);
  planner->setup();
  std::uint64_t rounds = 0;
  const std::uint64_t curves_before = checker.curves();
  const auto steps = [&] { return rounds + checker.curves() - curves_before; };
  const ob::PlannerTerminationCondition is_over([&] {
    ++rounds;
    return steps() > config.max_steps || (config.should_stop && config.should_stop());
  });
  (void)planner->solve(is_over);
  SearchResult result;
  result.steps = steps();
  if (!problem->hasSolution()) return result;
  result.reaches_goal = !problem->hasApproximateSolution();
  if (config.improved && config.planner == PlannerKind::rrt_connect && result.reaches_goal) {
    config.improved(problem->getSolutionPath()->length());
  }
  const auto* path = problem->getSolutionPath()->as<og::PathGeometric>();
  for (std::size_t i = 0; i < path->getStateCount(); ++i) {
    result.waypoints.push_back(pose_of(path->getState(static_cast<unsigned int>(i))));
  }
  return result;
}

}  // namespace stillmap
