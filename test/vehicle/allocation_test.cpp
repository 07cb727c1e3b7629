// Counts calls of operator new in a program of its own.
#include <gtest/gtest.h>

#include <cstdlib>
#include <new>

#include "truck_file.h"
#include "tunnel_pilot/vehicle/dynamic_truck.h"
#include "tunnel_pilot/vehicle/kinematic_truck.h"

namespace {
long g_allocations = 0;
}  // namespace

void* operator new(std::size_t size) {
  ++g_allocations;
  if (void* memory = std::malloc(size)) return memory;
  throw std::bad_alloc();
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

namespace tunnel_pilot::vehicle {
namespace {

long allocationsOf(Plant& plant) {
  const long before = g_allocations;
  plant.reset({}, 0.1, 3.0);
  for (int i = 0; i < 1000; ++i) plant.step({0.3, i < 500 ? 0.5 : -2.0}, {0.1, 0.6}, 0.001);
  return g_allocations - before;
}

TEST(Allocation, NoStepOfAnyTruckAllocates) {
  DynamicTruck dynamic(shippedTruck(), {Load::kLoaded, 1, true, 0.0});
  KinematicTruck kinematic(shippedTruck());
  EXPECT_GT(g_allocations, 0);  // the counter counts
  EXPECT_EQ(allocationsOf(dynamic), 0);
  EXPECT_EQ(allocationsOf(kinematic), 0);
}

}  // namespace
}  // namespace tunnel_pilot::vehicle
