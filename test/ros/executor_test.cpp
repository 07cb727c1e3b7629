// The thread that the stages of a manager share. Needs no ROS master.
#include "tunnel_pilot/ros/executor.h"

#include <gtest/gtest.h>

#include <boost/make_shared.hpp>
#include <functional>
#include <future>

namespace tunnel_pilot::shell {
namespace {

class Call : public ros::CallbackInterface {
 public:
  explicit Call(std::function<void()> work) : work_(std::move(work)) {}
  CallResult call() override {
    work_();
    return Success;
  }

 private:
  std::function<void()> work_;
};

class ExecutorTest : public testing::Test {
 protected:
  ~ExecutorTest() override {
    for (Executor::Queue* queue : {&urgent_, &middle_, &late_}) queue->stop();
  }

  static void ask(Executor::Queue& queue, const std::function<void()>& work) {
    queue.addCallback(boost::make_shared<Call>(work), 0);
  }
  void note(Executor::Queue& queue, char what) {
    ask(queue, [this, what] { notes_ += what; });
  }
  // Of what was asked for before and of what that asks for, in order; whoever is late comes last.
  std::string notes() {
    std::promise<void> end;
    ask(late_, [&] { ask(late_, [&] { end.set_value(); }); });
    end.get_future().wait();
    return notes_;
  }
  void start() {
    for (Executor::Queue* queue : {&late_, &urgent_, &middle_}) queue->start();
  }

  Executor executor_{"test"};
  Executor::Queue urgent_{executor_, 0}, middle_{executor_, 1}, late_{executor_, 2};
  std::string notes_;
};

TEST_F(ExecutorTest, TheLowestRankComesFirst) {
  start();
  ask(late_, [this] {
    note(late_, 'c');
    note(middle_, 'b');
    note(urgent_, 'a');
  });
  EXPECT_EQ("abc", notes());
}

TEST_F(ExecutorTest, OfOneStageTheCallbacksComeInTheirOrder) {
  start();
  ask(late_, [this] {
    for (const char what : {'a', 'b', 'c'}) note(middle_, what);
  });
  EXPECT_EQ("abc", notes());
}

TEST_F(ExecutorTest, WhatACallbackAsksForComesBeforeLaterRanks) {
  start();
  ask(late_, [this] {
    ask(middle_, [this] {
      notes_ += 'a';
      note(urgent_, 'b');
    });
    note(middle_, 'c');
    note(late_, 'd');
  });
  EXPECT_EQ("abcd", notes());
}

TEST_F(ExecutorTest, AQueueThatHasNotStartedIsNotServedAndLosesNothing) {
  late_.start();
  note(middle_, 'a');
  EXPECT_EQ("", notes());
  middle_.start();
  EXPECT_EQ("a", notes());
}

TEST_F(ExecutorTest, AQueueThatWasStoppedIsNotServed) {
  start();
  middle_.stop();
  note(middle_, 'a');
  EXPECT_EQ("", notes());
}

TEST_F(ExecutorTest, StopWaitsForTheCallbackThatRuns) {
  start();
  std::promise<void> runs, goes_on;
  bool ended = false;
  ask(middle_, [&] {
    runs.set_value();
    goes_on.get_future().wait();
    ended = true;
  });
  runs.get_future().wait();
  const std::future<void> other = std::async(std::launch::async, [&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    goes_on.set_value();
  });
  middle_.stop();
  EXPECT_TRUE(ended);
}

TEST_F(ExecutorTest, AllStagesShareOneThread) {
  start();
  std::thread::id urgent, late;
  ask(urgent_, [&] { urgent = std::this_thread::get_id(); });
  ask(late_, [&] { late = std::this_thread::get_id(); });
  notes();
  EXPECT_EQ(urgent, late);
  EXPECT_NE(urgent, std::this_thread::get_id());
}

TEST(Executor, IsTheSameForAllWhoNameIt) {
  const auto executor = Executor::named("one");
  EXPECT_EQ(executor, Executor::named("one"));
  EXPECT_NE(executor, Executor::named("another"));
}

TEST(Executor, EndsWithWhoHoldsItLast) {
  const std::weak_ptr<Executor> gone = Executor::named("one");
  EXPECT_EQ(nullptr, gone.lock());
}

TEST(Executor, EveryCallbackOfManyThreadsIsCalledOnce) {
  Executor executor("test");
  Executor::Queue first(executor, 0), second(executor, 1);
  first.start();
  second.start();
  constexpr int kEach = 20'000;
  int called = 0;  // in the executor's thread alone
  std::promise<void> end;
  const auto count = [&] {
    if (++called == 2 * kEach) end.set_value();
  };
  const auto ask = [&](Executor::Queue& queue) {
    for (int i = 0; i < kEach; ++i) queue.addCallback(boost::make_shared<Call>(count), 0);
  };
  std::thread other(ask, std::ref(second));
  ask(first);
  other.join();
  EXPECT_EQ(std::future_status::ready, end.get_future().wait_for(std::chrono::seconds(20)));
}

}  // namespace
}  // namespace tunnel_pilot::shell
