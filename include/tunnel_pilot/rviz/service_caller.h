#pragma once

#include <QObject>
#include <QString>
#include <memory>
#include <string>
#include <vector>

namespace tunnel_pilot::hud {

/// Calls std_srvs/Trigger services without ever letting the GUI wait: each call has a thread of its own,
/// so that a stop never stands behind a call that hangs. May be destroyed while calls are under way.
class ServiceCaller : public QObject {
  Q_OBJECT

 public:
  explicit ServiceCaller(QObject* parent = nullptr);
  ~ServiceCaller() override;

  /// Calls the first of the services that somebody offers.
  void call(const std::vector<std::string>& services);

 Q_SIGNALS:
  /// In the GUI's thread. `words` holds the service's name and answer, or what went wrong.
  void answered(bool accepted, const QString& words);

 private:
  struct Link;
  std::shared_ptr<Link> link_;
};

}  // namespace tunnel_pilot::hud
